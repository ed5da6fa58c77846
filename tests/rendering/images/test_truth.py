"""Truth by pixel, against rays, formulas and the rules of file formats that are written here."""

import json

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering import facets
from mi_lcair.rendering.images import truth as module
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.rendering.images.truth import Truth

T = mi.ScalarTransform4f
POSES = [(0, 0, 0), (20, 35, 10), (200, -50, 300), (77, 120, 5)]
HALVES = np.array([0.5, 0.3, 0.8])  # of the box's sides
SIZE = 24, 16


def thermal(temperature, group="self", **more):
    return {"type": "thermal", "temperature": temperature, "band": "LWIR", "group": group} | more


def made(sensor, settings=None, **shapes):
    """A loaded scene of these shapes, seen by a sensor with a film of SIZE.

    settings: of the integrator.
    """
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1]}
    parts = {
        "type": "scene",
        "integrator": {"type": "bounce_path"} | (settings or {}),
        "sensor": sensor | {"film": film},
    }
    return mi_lcair.load(mi.load_dict(parts | shapes, optimize=False))


def looking(origin, at=(0, 0, 0), kind="perspective", **more):
    matrix = T().look_at(origin=list(origin), target=list(at), up=[0, 0, 1])
    return {"type": kind, "to_world": matrix} | more


def lit_by(temperature, radius=30.0):
    """A blackbody around everything."""
    return {
        "type": "sphere",
        "radius": radius,
        "flip_normals": True,
        "bsdf": {"type": "grey", "emissivity": 1.0},
        "emitter": thermal(temperature, "around", facet_type="sky"),
    }


def grey(kind, emissivity, temperature, **more):
    surface = {"bsdf": {"type": "grey", "emissivity": emissivity}, "emitter": thermal(temperature)}
    return {"type": kind} | surface | more


def nearest_face(start, toward, rotation, centre):
    """Distance and outward normal at which a ray meets a turned box, by the slabs of its faces."""
    o, d = rotation.T @ (start - centre), rotation.T @ toward
    with np.errstate(divide="ignore"):
        near, far = np.sort([(-HALVES - o) / d, (HALVES - o) / d], axis=0)
    axis = near.argmax()
    if near[axis] > far.min():
        return None
    return near[axis], -np.sign(d[axis]) * rotation[:, axis]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_box_is_where_its_planes_are(pose, kind):
    """Depth, range, normal and facet of each pixel, from the planes of the box's faces."""
    turn = T().rotate([0, 0, 1], pose[0]).rotate([0, 1, 0], pose[1]).rotate([1, 0, 0], pose[2])
    rotation, centre = np.array(turn.matrix, float)[:3, :3], np.array([0.2, -0.1, 0.3])
    place = T().translate(centre.tolist()) @ turn @ T().scale(HALVES.tolist())
    eye, fov = np.array([4.0, 1.0, 2.0]), 35.0
    of_kind = {"fov": fov} if kind == "perspective" else {"near_clip": 0.7}
    sensor = looking(eye, kind=kind, **of_kind)
    if kind == "orthographic":
        sensor["to_world"] = sensor["to_world"] @ T().scale([1.5, 1.5, 2])
    scene = made(sensor, box=grey("cube", 0.5, 300, to_world=place))
    channels = mi_lcair.render(scene, spp=4, truth=True).truth.channels

    axis = -eye / np.linalg.norm(eye)
    right = np.cross(axis, [0, 0, 1]) / np.linalg.norm(np.cross(axis, [0, 0, 1]))
    up, (width, height) = np.cross(right, axis), SIZE
    half = np.tan(np.radians(fov / 2)) if kind == "perspective" else 1.5
    table, hits = facets.FacetTable(scene), 0
    for row in range(height):
        for column in range(width):
            x, y = half * (2 * (column + 0.5) / width - 1), half * (height - 2 * row - 1) / width
            aside = x * right + y * up
            start, toward = (eye, axis + aside) if kind == "perspective" else (eye + aside, axis)
            toward = toward / np.linalg.norm(toward)
            met = nearest_face(start, toward, rotation, centre)
            number = int(channels["IndexFacet.X"][row, column])
            assert (met is None) == (number == 0)
            found = [channels[f"Normal.{k}"][row, column] for k in "XYZ"]
            if met is None:
                assert found == [0, 0, 0] and channels["Depth.Z"][row, column] == 0
                continue
            distance, normal = met
            place = start + distance * toward
            assert channels["Depth.Z"][row, column] == pytest.approx((place - eye) @ axis, rel=2e-6)
            from_eye = np.linalg.norm(place - eye)
            assert channels["range.Y"][row, column] == pytest.approx(from_eye, rel=2e-6)
            np.testing.assert_allclose(found, normal, atol=2e-6)
            np.testing.assert_allclose(table.normal[number - 1], normal, atol=2e-6)
            hits += 1
    assert hits > 60
    assert np.all(channels["true_temperature.Y"][channels["IndexOB.X"] > 0] == 300)


def fresnel(cos, eta, k):
    """Reflectance of a conductor for unpolarised radiation: M. Born and E. Wolf, section 14.2."""
    n, sin2 = eta + 1j * k, 1 - cos**2
    inside = np.sqrt(n**2 - sin2)
    s, p = (cos - inside) / (cos + inside), (n**2 * cos - inside) / (n**2 * cos + inside)
    return (abs(s) ** 2 + abs(p) ** 2) / 2


def test_emissivity_follows_the_angle_of_a_smooth_ball():
    """1 - reflectance by Fresnel at the angle of the normal, which is that of shading.

    The parts of the radiance follow: what is emitted, and the mirror image of the surroundings.
    """
    eye, surface = np.array([5.0, 0.5, 1.0]), {"type": "conductor", "eta": 4.0, "k": 6.0}
    ball = {"type": "sphere", "bsdf": surface, "emitter": thermal(320.0)}
    scene = made(looking(eye, fov=25), ball=ball, around=lit_by(280.0))
    result = mi_lcair.render(scene, spp=4, truth=True)
    channels = result.truth.channels
    on = channels["true_temperature.Y"] == 320
    normal = np.stack([channels[f"Normal.{k}"] for k in "XYZ"], axis=-1)[on]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-5)
    cos = np.sum((eye - normal) * normal, axis=1) / np.linalg.norm(eye - normal, axis=1)
    expected = 1 - fresnel(cos, 4.0, 6.0)
    np.testing.assert_allclose(channels["emissivity.Y"][on], expected, atol=1e-4)
    assert np.ptp(expected) > 0.1  # the angle matters
    whole = on & (channels["mask.Y"] == 1)
    inner = np.zeros_like(on)
    inner[5:11, 9:15] = True  # where a pixel sees hardly more than one angle
    emitted, reflected = (
        channels[name][inner & whole] for name in ("emitted.Y", "reflected.around.Y")
    )
    e = channels["emissivity.Y"][inner & whole]
    np.testing.assert_allclose(emitted, e * in_band_radiance(band("LWIR"), 320.0), rtol=5e-3)
    np.testing.assert_allclose(
        reflected, (1 - e) * in_band_radiance(band("LWIR"), 280.0), rtol=5e-3
    )
    assert np.all(channels["emissivity.Y"][~on] == 1)


def test_parts_add_up_to_the_radiance_and_name_what_sent_it():
    """A grey plate in a warm room: its emission, and what it reflects of each part of the room."""
    B = {temperature: in_band_radiance(band("LWIR"), temperature) for temperature in (350.0, 290.0)}
    scene = made(
        looking([0.0, 0.0, 3.0], fov=40)
        | {"to_world": T().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])},
        plate=grey("rectangle", 0.3, 350.0, to_world=T().scale([0.9, 0.5, 1])),
        around=lit_by(290.0),
    )
    result = mi_lcair.render(scene, spp=16, truth=True)
    plain = mi_lcair.render(scene, spp=16)
    assert plain.truth is None and plain.header == result.header
    for name, values in plain.channels.items():
        np.testing.assert_array_equal(values, result.channels[name], err_msg=name)
    assert set(plain.channels) == set(result.channels)
    layers = {name: values.astype(float) for name, values in result.truth.channels.items()}
    names = [name for name in layers if name == "emitted.Y" or name.startswith("reflected.")]
    assert sorted(names) == ["emitted.Y", "reflected.around.Y", "reflected.self.Y"]
    np.testing.assert_allclose(sum(map(layers.get, names)), layers["Y"], rtol=3e-7)
    inside, outside = layers["mask.Y"] == 1, layers["mask.Y"] == 0
    assert inside.sum() > 20 and outside.sum() > 20
    np.testing.assert_allclose(layers["emitted.Y"][inside], 0.3 * B[350.0], rtol=1e-5)
    np.testing.assert_allclose(layers["reflected.around.Y"][inside], 0.7 * B[290.0], rtol=1e-5)
    np.testing.assert_allclose(layers["emitted.Y"][outside], B[290.0], rtol=1e-5)
    assert not layers["reflected.self.Y"].any()
    # The share of the pixels that the plate covers is its area among that of the window
    covered = 1.8 * 1.0 / (2 * 3 * np.tan(np.radians(20))) ** 2 * SIZE[0] / SIZE[1]
    assert layers["mask.Y"].mean() == pytest.approx(covered, rel=0.01)
    np.testing.assert_array_equal(layers["apparent.Y"], layers["Y"])
    spectral = mi_lcair.render(scene, spp=16, bins=2, truth=True).truth.channels
    np.testing.assert_array_equal(spectral["mask.Y"], result.truth.channels["mask.Y"])
    np.testing.assert_allclose(layers["apparent_temperature.Y"][outside], 290, rtol=1e-6)
    # The error of the temperature is that of the radiance over Planck's slope
    slope = (in_band_radiance(band("LWIR"), 290.01) - in_band_radiance(band("LWIR"), 289.99)) / 0.02
    np.testing.assert_allclose(
        layers["stderr.apparent_temperature.Y"][outside],
        layers["stderr.apparent.Y"][outside] / slope,
        rtol=1e-3,
    )


def test_the_air_of_each_pixel():
    """Apparent radiance is transmittance times radiance and the path, and the background as it is.

    The transmittance of a blackbody's spectrum and the path are integrals of the air's tables.
    """
    scene = made(
        looking([400.0, 0, 0], fov=0.4), plate=grey("sphere", 1.0, 330.0), around=lit_by(250.0, 900)
    )
    result = mi_lcair.render(scene, spp=4, truth=True, atmosphere="midlat_summer")
    layers = {name: values.astype(float) for name, values in result.truth.channels.items()}
    np.testing.assert_allclose(
        layers["transmittance.Y"] * layers["target.Y"] + layers["path.Y"] + layers["background.Y"],
        result.channels["apparent.Y"],
        rtol=3e-7,
    )
    inside = layers["mask.Y"] == 1
    air = atmosphere("midlat_summer").path(399.0)
    x = np.linspace(8, 12, 8001)
    transmittance, path = air.at(x)
    planck = 1 / (x**5 * np.expm1(14387.77 / (x * 330.0)))
    mean = np.trapezoid(transmittance * planck, x) / np.trapezoid(planck, x)
    np.testing.assert_allclose(layers["transmittance.Y"][inside], mean, rtol=1e-3)
    np.testing.assert_allclose(layers["path.Y"][inside], np.trapezoid(path, x), rtol=2e-3)
    assert not layers["background.Y"][inside].any() and inside.sum() > 30
    # On the edge the share of the target is uncertain, and what arrives in its place
    edge = (layers["mask.Y"] > 0) & ~inside
    hot, cold = (in_band_radiance(band("LWIR"), kelvin) for kelvin in (330.0, 250.0))
    arrives = mean * hot + np.trapezoid(path, x)
    np.testing.assert_allclose(
        layers["stderr.apparent.Y"][edge] / layers["stderr.Y"][edge],
        (arrives - cold) / (hot - cold),
        rtol=2e-3,
    )


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "thinlens"])
def test_ranges_begin_at_the_camera(kind):
    """Wherever its rays begin, and with them the air of a pixel."""
    lens = {"aperture_radius": 0.01, "focus_distance": 400.0} if kind == "thinlens" else {}
    fov = {} if kind == "orthographic" else {"fov": 0.5}
    near, far = (
        mi_lcair.render(
            made(looking([400.0, 0, 0], kind=kind, near_clip=clip, **fov, **lens), ball=ball),
            spp=16,
            atmosphere="midlat_summer",
        )
        for clip in (0.01, 300.0)
        for ball in [grey("sphere", 1.0, 330.0)]
    )
    seen = near.channels["target.Y"] == near.channels["target.Y"].max()
    assert near.channels["range.Y"][8, 12] == pytest.approx(399, abs=0.2)
    for name in ("range.Y", "apparent.Y", "path.Y"):
        np.testing.assert_allclose(far.channels[name][seen], near.channels[name][seen], rtol=1e-4)


@pytest.mark.parametrize("count, clip", [(1, 0.5), (3, 0.01)])
def test_each_camera_of_a_batch_has_its_own_place(count, clip):
    """Its sensors are side by side on the film, and look at the plane z = 0 from their heights."""
    heights, width = [5.0, 7.0, 9.0][:count], SIZE[0] // count
    cameras = {
        f"camera_{k}": {
            "type": "perspective",
            "fov": 20,
            "near_clip": clip,
            "to_world": T().look_at([k, 0, z], [k, 0, 0], [0, 1, 0]),
        }
        for k, z in enumerate(heights)
    }
    floor = grey("rectangle", 1.0, 300.0, to_world=T().scale([90, 90, 1]))
    result = mi_lcair.render(made({"type": "batch"} | cameras, floor=floor), spp=16, truth=True)
    channels, expected = result.truth.channels, np.repeat(heights, width)
    np.testing.assert_allclose(channels["Depth.Z"], np.tile(expected, (SIZE[1], 1)), rtol=1e-6)
    middle = width // 2 + width * np.arange(count)
    np.testing.assert_allclose(channels["range.Y"][8, middle], heights, rtol=5e-3)
    np.testing.assert_allclose(result.channels["range.Y"], channels["range.Y"], rtol=5e-3)


def test_a_sensor_without_a_place_is_refused():
    sensor = {"type": "distant", "film": {"type": "hdrfilm", "width": 1, "height": 1}}
    sensor["film"]["rfilter"] = {"type": "box"}
    scene = made(looking([4, 1, 2]), box=grey("cube", 0.5, 300), far=sensor)
    with pytest.raises(InputError, match="perspective, .* and not a DistantSensor"):
        mi_lcair.render(scene, sensor=1, spp=4, truth=True)


def test_instances_plumes_and_backs():
    """Each instance of a group has a number. A plume is seen first, and emits 1 - transmittance."""
    down = T().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]) @ T().scale([4, 4, 1])
    mirror = {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": 0.5}}
    scene = made(
        {"type": "orthographic", "to_world": down},
        group={"type": "shapegroup", "part": mirror},
        left={
            "type": "instance",
            "to_world": T().translate([-2, 0, 0]),
            "ref": {"type": "ref", "id": "group"},
        },
        right={
            "type": "instance",
            "to_world": T().translate([2, 0, 0]),
            "ref": {"type": "ref", "id": "group"},
        },
        gas={
            "type": "rectangle",
            "to_world": T().translate([0, 0, 1]).scale([0.5, 2, 1]),
            "bsdf": {"type": "plume", "transmittance": 0.8},
            "emitter": thermal(600.0, "gas"),
        },
        floor=grey("rectangle", 0.9, 300.0, to_world=T().translate([0, 0, -1]).scale([9, 9, 1])),
    )
    truth = mi_lcair.render(scene, spp=4, truth=True).truth
    names = truth.legend["instance"]
    shown = np.vectorize(names.get)(truth.ids("instance"))
    assert [shown[8, k] for k in (6, 12, 18)] == ["left", "gas", "right"] and shown[0, 0] == "floor"
    assert truth.channels["emissivity.Y"][8, 12] == pytest.approx(0.2)
    assert truth.channels["true_temperature.Y"][8, [6, 12]].tolist() == [0, 600]
    assert len({truth.ids("facet")[8, k] for k in (6, 12, 18)}) == 3
    assert truth.legend["facet"][int(truth.ids("facet")[8, 6])] == "left, other, SmoothDiffuse"
    under = T().look_at([0, 0, -5], [0, 0, 0], [0, 1, 0]) @ T().scale([2, 2, 1])
    below = made({"type": "orthographic", "to_world": under}, floor=grey("rectangle", 0.9, 300.0))
    back = mi_lcair.render(below, spp=4, truth=True).truth.channels
    # The back of a one-sided surface is there, emits nothing, and its normal is toward the camera
    assert back["IndexOB.X"][8, 12] == 1 and back["emissivity.Y"][8, 12] == 0
    assert back["Normal.Z"][8, 12] == -1


def test_temperatures_of_facets(tmp_path):
    """The numbers are those of `facets`, and the temperatures those of its table."""
    scene = mi_lcair.load("a340_landing", position=3, band="LWIR", resolution=24)
    truth, table = mi_lcair.render(scene, spp=4, truth=True).truth, facets.FacetTable(scene)
    np.testing.assert_array_equal(truth.ids("facet"), facets.seen_facets(scene, table) + 1)
    shown = truth.ids("facet") - 1
    expected = np.nan_to_num(table.temperature[shown])
    np.testing.assert_allclose(truth.channels["true_temperature.Y"], expected, rtol=1e-6)
    for kind in ("group", "material"):
        names = np.vectorize(truth.legend[kind].get)(truth.ids(kind))
        np.testing.assert_array_equal(names, getattr(table, kind)[shown])


def test_rest_is_what_the_closure_adds():
    """Plates that face each other: after one reflection all is taken to be at 290 K."""
    closure = {"closure": "ambient", "ambient_temperature": 290.0, "max_bounces": 1}
    scene = made(
        looking([3.0, 0.0, 0.0], fov=20)
        | {"to_world": T().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])},
        closure,
        plate=grey("rectangle", 0.3, 350.0, to_world=T().scale([9, 9, 1])),
        lid=grey(
            "rectangle",
            0.6,
            320.0,
            to_world=T().translate([0, 0, 4]).rotate([0, 1, 0], 180).scale(99),
        ),
    )
    layers = mi_lcair.render(scene, spp=1, truth=True).truth.channels
    B = {kelvin: in_band_radiance(band("LWIR"), kelvin) for kelvin in (350.0, 320.0, 290.0)}
    np.testing.assert_allclose(layers["emitted.Y"], 0.3 * B[350.0], rtol=1e-5)
    # A path or two escape between the plates
    assert np.median(layers["reflected.self.Y"]) == pytest.approx(0.7 * 0.6 * B[320.0], rel=1e-5)
    assert np.median(layers["rest.Y"]) == pytest.approx(0.7 * 0.4 * B[290.0], rel=1e-5)
    np.testing.assert_allclose(
        layers["emitted.Y"] + layers["reflected.self.Y"] + layers["rest.Y"], layers["Y"], rtol=3e-7
    )
    # One path through a pixel says nothing of its error
    assert not any(name.startswith("stderr.") for name in layers)
    assert "stderr.Y" in mi_lcair.render(scene, spp=2, truth=True).truth.channels


def test_temperatures_and_their_errors():
    """Planck's slope at a radiance, and none where nothing arrives."""
    radiance = np.array([0.0, -1e-9, in_band_radiance(band("MWIR"), 40.0), 2.0])
    errors = np.array([np.inf, 1e-9, 1e-9, 1e-9])  # infinite after one path
    layers = module.apparent_temperature(band("MWIR"), radiance, errors)
    T, error = layers["apparent_temperature.Y"], layers["stderr.apparent_temperature.Y"]
    assert T[:2].tolist() == error[:2].tolist() == [0, 0] and T[2] == pytest.approx(40)
    slope = np.diff(in_band_radiance(band("MWIR"), T[3] + np.array([-0.01, 0.01])))[0] / 0.02
    assert error[3] == pytest.approx(1e-9 / slope, rel=1e-5)


def drawn(**layers) -> Truth:
    """A truth of given layers, whose groups and instances are "a" and "b"."""
    shape = next(iter(layers.values())).shape
    channels = dict.fromkeys([*module.LAYERS.values(), "mask.Y"], np.zeros(shape, np.float32))
    named = {1: "a", 2: "b"}
    legend = {kind: named if kind in ("group", "instance") else {} for kind in module.LAYERS}
    return Truth(channels | layers, legend, {"scene": "drawn"})


def decoded(code: dict) -> np.ndarray:
    """The mask of a run-length code, by the rules of COCO: columns first, and 0 first."""
    pixels = []
    for k, count in enumerate(code["counts"]):
        pixels += [k % 2] * count
    height, width = code["size"]
    return np.array([[pixels[x * height + y] for x in range(width)] for y in range(height)], bool)


@pytest.mark.parametrize("seed", range(5))
def test_masks_are_read_by_the_rules_of_coco(seed):
    random = np.random.default_rng(seed)
    ids = random.choice([0, 1, 2], (7, 9), p=[0.6, 0.3, 0.1]).astype(np.float32)
    ids[:, [0, -1]] = random.choice([0, 1], 2)
    truth = drawn(**{"IndexOB.X": ids, "mask.Y": (ids > 0) * np.float32(0.5)})
    coco = truth.coco("frame.png", 7, 100)
    assert coco["images"] == [{"id": 7, "file_name": "frame.png", "width": 9, "height": 7}]
    names = {entry["id"]: (entry["supercategory"], entry["name"]) for entry in coco["categories"]}
    assert list(names.values()) == [
        ("target", "target"),
        ("group", "a"),
        ("group", "b"),
        ("instance", "a"),
        ("instance", "b"),
    ]
    expected = {
        ("target", "target"): ids > 0,
        ("instance", "a"): ids == 1,
        ("instance", "b"): ids == 2,
    }
    expected = {name: mask for name, mask in expected.items() if mask.any()}
    assert [names[entry["category_id"]] for entry in coco["annotations"]] == list(expected)
    for number, (entry, mask) in enumerate(zip(coco["annotations"], expected.values()), 100):
        assert entry["id"] == number and entry["image_id"] == 7 and entry["iscrowd"] == 0
        np.testing.assert_array_equal(decoded(entry["segmentation"]), mask)
        x, y, width, height = entry["bbox"]
        inside = np.zeros_like(mask)
        inside[y : y + height, x : x + width] = True
        assert entry["area"] == mask.sum() and not (mask & ~inside).any()
        assert mask[y].any() and mask[y + height - 1].any() and mask[:, x].any()
        assert mask[:, x + width - 1].any()


def test_a_target_below_half_a_pixel_has_a_mask():
    share = np.zeros((4, 4), np.float32)
    share[1, 2:] = 0.4, 0.01
    (entry,) = drawn(**{"mask.Y": share}).coco()["annotations"]
    np.testing.assert_array_equal(decoded(entry["segmentation"]), share > 0)
    assert drawn(**{"mask.Y": np.zeros((4, 4), np.float32)}).coco()["annotations"] == []


def test_files(tmp_path):
    """Numbers are exact in the EXR and the PNG, or refused."""
    ids = np.array([[0, 1, 65535], [40000, 2**24 - 1, 2**24 - 2]], np.float32)
    small = np.where(ids > 65535, 2, ids)
    with pytest.raises(
        InputError, match="PNG can have numbers up to 65535, and a facet has number 16"
    ):
        drawn(**{"IndexFacet.X": ids}).write_ids(tmp_path / "x.png", "facet")
    assert list(tmp_path.iterdir()) == []
    with pytest.warns(UserWarning, match="no PNG with the numbers of each facet .* IndexFacet.X"):
        written = drawn(**{"IndexFacet.X": ids, "IndexOB.X": small}).save(tmp_path / "seen")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    assert tmp_path / "seen.facet.png" not in written  # its numbers do not fit
    with Image.open(tmp_path / "seen.instance.png") as picture:
        assert picture.mode.startswith("I;16")
        np.testing.assert_array_equal(np.asarray(picture), small)
    channels, header = read_exr(tmp_path / "seen.truth.exr")
    np.testing.assert_array_equal(channels["IndexFacet.X"].astype(int), ids.astype(int))
    assert header["scene"] == "drawn"
    assert json.loads((tmp_path / "seen.legend.json").read_text())["group"] == {"1": "a", "2": "b"}
    assert json.loads((tmp_path / "seen.coco.json").read_text())["images"][0]["width"] == 3


def test_more_facets_than_numbers_are_refused(monkeypatch):
    assert float(np.float32(module.MOST_FACETS)) == module.MOST_FACETS
    assert float(np.float32(module.MOST_FACETS + 2)) != module.MOST_FACETS + 2
    monkeypatch.setattr(module, "MOST_FACETS", 10)
    scene = made(looking([4, 1, 2]), box=grey("cube", 0.5, 300))
    with pytest.raises(InputError, match="has 12 facets; layers of an image number 10 at most"):
        mi_lcair.render(scene, spp=4, truth=True)
