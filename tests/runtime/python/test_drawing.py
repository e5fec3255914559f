"""Surfaces, examples, targets, energies, times and load capacity, beside what the bundle and a body's motion say."""
import numpy as np
import pytest

import exmat


def placed(body, rest, basis):
    """R (X + U q) + t."""
    rotation, shift = body.placement[:, :3], body.placement[:, 3]
    return (rest + basis.astype("f8") @ body.q) @ rotation.T + shift


@pytest.fixture(scope="module")
def surface(model):
    return exmat.Surface(model)


@pytest.fixture
def spinning(free_bundle):
    body = exmat.Body(exmat.Model(free_bundle, use_contact=True))
    body.motion = exmat.Motion(position=(1, 2, 3), angular_velocity=(1, 3, 2))
    body.step(100)
    return body


def test_a_surface_is_the_closed_boundary_of_the_object(surface, model, bundle):
    triangles, rest = surface.triangles, surface.rest
    a, b, c = (rest[triangles[:, corner]] for corner in range(3))
    with exmat.Bundle(bundle) as file:
        vertices = file["object/vertices"][:]
    sides = vertices.max(0) - vertices.min(0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(sides.prod(), rel=1e-12)  # outward: positive
    assert surface.kind == "object" and len(surface) == len(rest)
    np.testing.assert_array_equal(rest, vertices[surface.vertices])
    with pytest.raises(exmat.Error, match="render"):
        exmat.Surface(model, "render")
    with pytest.raises(exmat.InvalidArgument, match="kind"):
        exmat.Surface(model, "skin")


# Single precision of coordinates of some metres: two roundings of 2.4e-7.
def test_points_stand_where_rest_basis_and_placement_say(spinning):
    surface = exmat.Surface(spinning.model)
    out = np.empty((len(surface), 3), "f4")
    assert spinning.positions(surface, out) is out
    np.testing.assert_allclose(out, placed(spinning, surface.rest, surface.basis), rtol=0, atol=1e-6)
    points = exmat.Points(spinning.model, surface.vertices)
    np.testing.assert_array_equal(out, spinning.positions(points))
    np.testing.assert_array_equal(points.basis, surface.basis)
    np.testing.assert_allclose(np.linalg.det(spinning.placement[:, :3]), 1, rtol=1e-12)


def test_normals_are_sums_of_vector_areas(spinning):
    surface = exmat.Surface(spinning.model)
    xyz = spinning.positions(surface)
    sums = np.zeros((len(surface), 3))
    a, b, c = (xyz[surface.triangles[:, corner]].astype("f8") for corner in range(3))
    for corner in range(3):
        np.add.at(sums, surface.triangles[:, corner], np.cross(b - a, c - a))
    normals = surface.normals(xyz)
    assert normals.dtype == np.float32
    np.testing.assert_allclose(normals, sums / np.linalg.norm(sums, axis=1)[:, None], rtol=0, atol=1e-5)  # 1 ulp of 3 m over edges of 0.1 m
    with pytest.raises(exmat.InvalidArgument, match="positions"):
        surface.normals(xyz[1:])


# The basis of a surface is rounded to single precision, the positions are not.
@pytest.mark.parametrize("step", [0, 100])
def test_positions_in_double_precision_are_those_of_the_bundle(free_bundle, step):
    body = exmat.Body(exmat.Model(free_bundle, gravity=(0, 0, -1)))
    body.motion = exmat.Motion(position=(1, 2, 3), angular_velocity=(1, 3, 2))
    body.step(step)
    with exmat.Bundle(free_bundle) as file:
        expected = placed(body, file["object/vertices"][:], file["modal/basis"][:])
    ids = np.arange(len(expected))
    points, out = exmat.Points(body.model, ids), np.empty((len(ids), 3))
    assert body.positions(points, out) is out
    np.testing.assert_allclose(out, expected, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(out.astype("f4"), body.positions(points, np.empty_like(out)).astype("f4"))
    surface = exmat.Surface(body.model)
    np.testing.assert_array_equal(body.positions(surface, np.empty((len(surface), 3))), out[surface.vertices])
    with pytest.raises(exmat.InvalidArgument, match="single precision"):
        body.positions(exmat.Points.all_vertices(body.model), out)
    batch = exmat.Batch(body.model, 2)
    batch.set_reduced(np.stack([body.q, 0 * body.q]), np.zeros((2, body.model.modes)))
    both = batch.positions(points, np.empty((2, *out.shape)))
    with exmat.Bundle(free_bundle) as file:
        np.testing.assert_allclose(both[1], file["object/vertices"][:], rtol=0, atol=1e-13)


# Central differences of step h err by h^2 and by rounding over h: 1e-6 of the largest entry is well above both.
def test_force_and_tangent_are_derivatives_of_the_energy(model):
    q = 0.3 * model.example_pose("twist")
    h = 1e-5 * np.linalg.norm(q)
    energy, force, tangent = model.elasticity(q)
    sides = [[model.elasticity(q + side * h * axis) for side in (1, -1)] for axis in np.eye(model.modes)]
    np.testing.assert_allclose([(a[0] - b[0]) / (2 * h) for a, b in sides], force, rtol=0, atol=1e-6 * abs(force).max())
    np.testing.assert_allclose([(a[1] - b[1]) / (2 * h) for a, b in sides], tangent, rtol=0, atol=1e-6 * abs(tangent).max())
    np.testing.assert_array_equal(tangent, tangent.T)
    still = exmat.Body(model)
    still.set_reduced(q, 0 * q)
    assert still.energies.elastic == pytest.approx(energy, rel=1e-12)
    for wrong in (q[1:], q * np.nan):
        with pytest.raises(exmat.InvalidArgument):
            model.elasticity(wrong)


def test_matrices_are_those_that_the_bundle_was_made_of(model, bundle, monkeypatch):
    linalg = pytest.importorskip("scipy.sparse.linalg")
    with exmat.Bundle(bundle) as file:
        vertices, density, basis = file["object/vertices"][:], file["object/density"][:], file["modal/basis"][:].reshape(-1, model.modes)
        frequencies, free = file["modal/frequencies"][:], np.repeat(file["object/fixed"][:] == 0, 3)
    mass, stiffness = model.mass_matrix(), model.stiffness_matrix()
    assert mass.shape == stiffness.shape == (basis.shape[0],) * 2
    for matrix in (mass, stiffness):
        assert abs(matrix - matrix.T).max() <= 1e-15 * abs(matrix).max() and matrix.has_sorted_indices
    np.testing.assert_allclose(basis.T @ (mass @ basis), np.eye(model.modes), rtol=0, atol=1e-9)
    volume = (vertices.max(0) - vertices.min(0)).prod()
    along = np.tile([1.0, 0, 0], len(vertices))
    assert along @ (mass @ along) == pytest.approx(density[0] * volume, rel=1e-12)
    assert abs(stiffness @ along).max() <= 1e-9 * abs(stiffness).max()
    squares = linalg.eigsh(stiffness[free][:, free].tocsc(), 3, mass[free][:, free].tocsc(), sigma=0, return_eigenvectors=False)
    np.testing.assert_allclose(np.sqrt(np.sort(squares)) / (2 * np.pi), frequencies[:3], rtol=1e-8)
    monkeypatch.setitem(__import__("sys").modules, "scipy.sparse", None)
    data, indices, indptr = model.mass_matrix()
    np.testing.assert_array_equal(data, mass.data)
    np.testing.assert_array_equal(indices, mass.indices)
    np.testing.assert_array_equal(indptr, mass.indptr)


def test_points_on_triangles_lie_between_their_corners(spinning):
    surface = exmat.Surface(spinning.model)
    triangles, shares = [0, 7, 7], [[1 / 3, 1 / 3, 1 / 3], [0.2, 0.3, 0.5], [1, 0, 0]]
    points = surface.points(triangles, shares)
    corners = spinning.positions(surface).astype("f8")[surface.triangles[triangles]]
    np.testing.assert_allclose(spinning.positions(points), np.einsum("ks,ksx->kx", shares, corners), rtol=0, atol=1e-6)
    spinning.apply_forces(points, np.ones((3, 3)))
    for wrong in ([[1, 0, 0]], np.zeros((3, 2))):
        with pytest.raises(exmat.InvalidArgument, match="shares"):
            surface.points(triangles, wrong)


def test_examples_have_the_poses_of_the_bundle(model, bundle):
    assert model.example_names() == ["rest", "twist"]
    with exmat.Bundle(bundle) as file:
        np.testing.assert_array_equal(model.example_pose("twist"), file["examples/twist/pose"][:])
    np.testing.assert_array_equal(model.example_pose("rest"), 0)
    for call in (lambda: model.example_pose("bend"), lambda: model.example_names("arm"), lambda: exmat.Body(model).target("arm")):
        with pytest.raises(exmat.InvalidArgument, match="none that is named"):
            call()


# Between two examples the target goes from one to the other: the force of the next step follows it.
def test_the_target_is_what_the_examples_draw_to(model, body, bundle):
    body.set_example_weights([1, 0])
    body.step()
    size = np.linalg.norm(model.example_pose("twist"))
    assert np.linalg.norm(body.target()) < 1e-9 * size
    body.set_example_weights([0, 1])
    body.step(3000)
    drawn = body.target()
    still = exmat.Body(exmat.Model(bundle, example_stiffness=4e6, example_damping=4000, example_bias=0.2))
    still.set_example_weights([0, 1])
    still.step(3000)
    np.testing.assert_allclose(still.target(), drawn, rtol=0, atol=1e-9 * size)  # of the weights alone
    assert np.linalg.norm(still.q - drawn) < 0.05 * np.linalg.norm(drawn)        # a thousand times as strong: nearly there


# St.Venant-Kirchhoff near rest: half of the displacement has a quarter of the energy.
def test_energy_density_is_quadratic_near_rest(model, body, surface):
    np.testing.assert_array_equal(body.energy_density(surface), 0)
    pose = 1e-4 * model.example_pose("twist")
    body.set_reduced(pose, 0 * pose)
    whole = body.energy_density(surface)
    body.set_reduced(pose / 2, 0 * pose)
    np.testing.assert_allclose(body.energy_density(surface), whole / 4, rtol=2e-3)
    assert whole.min() > 0


def test_a_ray_meets_the_body_where_it_is(model, body, surface):
    pose = 0.3 * np.sin(1 + np.arange(model.modes))
    body.set_reduced(pose, 0 * pose)
    middle = body.positions(surface).mean(0).astype(float)
    hit = body.cast_ray(surface, middle + [0, 0, 10], [0, 0, -3])
    place = body.positions(surface.points([hit.triangle], [hit.shares]), np.empty((1, 3)))[0]
    np.testing.assert_allclose(place, middle + [0, 0, 10 - hit.distance], atol=1e-12)
    assert hit.normal[2] > 0 and np.linalg.norm(hit.normal) == pytest.approx(1)
    assert body.cast_ray(surface, middle, [0, 0, 1]).normal[2] > 0  # from inside
    assert body.cast_ray(surface, middle + [0, 0, 10], [0, 0, -3], within=5) is None
    for origin, direction in (([0, 0, np.nan], [0, 0, 1]), ([0, 0, 0], [0, 0, 0])):
        with pytest.raises(exmat.InvalidArgument, match="direction"):
            body.cast_ray(surface, origin, direction)


def test_elements_lie_in_the_object_and_have_weights(model):
    points = exmat.Points.elements(model)
    rest = exmat.Surface(model).rest
    assert len(points) == len(model.element_weights) == 30
    assert (points.rest >= rest.min(0)).all() and (points.rest <= rest.max(0)).all() and (model.element_weights >= 0).all()


def test_reports_have_the_work_that_a_capacity_says(model, body, surface):
    capacity = exmat.Capacity(model, spread=0.3)
    tip = surface.points([int(np.argmax(surface.rest[surface.triangles].mean(1)[:, 0]))], [[1 / 3] * 3])
    body.step()
    assert body.report.lost_applied < 0 and body.report.lost_contact < 0
    body.set_capacity(capacity)
    force = [[0, 0, 50]]
    body.apply_forces(tip, force)
    report = body.step()
    lost = capacity.lost(body, tip, force)
    assert 0 < lost < 1 and report.lost_applied == pytest.approx(lost, rel=1e-6)
    assert report.lost_contact == capacity.contact_lost(body) == 0
    assert capacity.time_scale > 0
    body.set_capacity(None)
    assert body.step().lost_applied < 0


@pytest.mark.parametrize("make", [exmat.Body, lambda model: exmat.Batch(model, 5)], ids=["body", "batch"])
def test_a_profile_adds_up_to_less_than_the_call(model, make):
    stepped = make(model)
    stepped.step(10)
    assert not any(stepped.profile.values())
    stepped.set_profiled(True)
    seconds = stepped.step(200).seconds
    profile = stepped.profile
    assert list(profile) == ["weights", "target", "internal_force", "solve", "contact", "broad_phase", "candidates", "single_bodies", "islands"]
    assert profile["internal_force"] > 0 and profile["solve"] > 0 and profile["islands"] == 0
    assert 0 < profile["single_bodies"] <= seconds
