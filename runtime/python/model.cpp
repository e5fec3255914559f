#include <array>
#include <pybind11/stl.h>

#include "runtime/python/objects.h"

namespace exmat::python {
namespace {

/// `value` as what a setting is.
template <typename Value>
Value setting(const std::string& name, const py::handle& value, const char* expected) {
  try {
    return value.cast<Value>();
  } catch (const std::runtime_error&) {  // of another type
    const std::string found = py::str(py::repr(value));
    throw Error(EXMAT_INVALID_ARGUMENT, (name + " = " + found + ": expected " + expected).c_str());
  }
}

exmat_settings settings_of(const py::dict& given) {
  exmat_settings settings = default_settings();
  const std::map<std::string, double exmat_settings::*> numbers{
      {"time_step", &exmat_settings::time_step},
      {"mass_damping", &exmat_settings::mass_damping},
      {"stiffness_damping", &exmat_settings::stiffness_damping},
      {"newton_tolerance", &exmat_settings::newton_tolerance},
      {"example_stiffness", &exmat_settings::example_stiffness},
      {"example_damping", &exmat_settings::example_damping},
      {"example_bias", &exmat_settings::example_bias},
      {"sleep_energy", &exmat_settings::sleep_energy},
      {"sleep_time", &exmat_settings::sleep_time},
      {"space_release", &exmat_settings::space_release}};
  const std::map<std::string, std::int32_t exmat_settings::*> counts{
      {"newton_iterations", &exmat_settings::newton_iterations},
      {"target_iterations", &exmat_settings::target_iterations},
      {"use_examples", &exmat_settings::use_examples},
      {"use_contact", &exmat_settings::use_contact}};
  for (const auto& [key, value] : given) {
    const auto name = key.cast<std::string>();
    if (const auto number = numbers.find(name); number != numbers.end())
      settings.*(number->second) = setting<double>(name, value, "a number");
    else if (const auto count = counts.find(name); count != counts.end())
      settings.*(count->second) = setting<std::int32_t>(name, value, "a whole number");
    else if (name == "gravity")
      std::ranges::copy(setting<std::array<double, 3>>(name, value, "three numbers [m/s^2]"), settings.gravity);
    else if (name == "integrator")
      settings.integrator = number_of(value, "integrator", kIntegrators);
    else if (name == "precision")
      settings.precision = number_of(value, "precision", {"double", "mixed"});
    else if (name == "space")
      settings.space = number_of(value, "space", kSpaces);
    else if (name == "internal_force")
      settings.internal_force = number_of(value, "internal_force", {"auto", "cubature", "polynomial"});
    else if (name == "example_target")
      settings.example_target = number_of(value, "example_target", {"auto", "table", "solve"});
    else if (name == "energy_reference")
      settings.energy_reference = number_of(value, "energy_reference", {"example", "rest"});
    else
      throw Error(EXMAT_INVALID_ARGUMENT, ("there is no setting " + name).c_str());
  }
  return settings;
}

/// Loads the model of a scene where `settings` is None, else of a bundle.
std::shared_ptr<ModelObject> load(const std::string& path, const py::object& settings) {
  if (settings.is_none()) {
    const py::gil_scoped_release unlocked;
    return std::make_shared<ModelObject>(Model::from_scene(path));
  }
  const exmat_settings members = settings_of(settings.cast<py::dict>());
  const py::gil_scoped_release unlocked;
  return std::make_shared<ModelObject>(Model(path, members));
}

std::shared_ptr<ModelObject> of_pack(const py::bytes& pack, const py::dict& settings) {
  const std::string_view bytes = pack;
  const exmat_settings members = settings_of(settings);
  const py::gil_scoped_release unlocked;
  return std::make_shared<ModelObject>(Model::from_memory(std::as_bytes(std::span(bytes)), members));
}

std::shared_ptr<ModelObject> of_text(const std::string& scene, const std::string& path, bool use_contact) {
  const py::gil_scoped_release unlocked;
  return std::make_shared<ModelObject>(Model::from_text(scene, path, use_contact));
}

template <typename Make>
Points without_lock(const Make& make) {
  const py::gil_scoped_release unlocked;
  return make();
}

std::shared_ptr<PointsObject> made(Points points, const std::shared_ptr<ModelObject>& model) {
  return std::make_shared<PointsObject>(std::move(points), model);
}

std::shared_ptr<PointsObject> vertices(const std::shared_ptr<ModelObject>& model, const py::object& given) {
  const Ids ids = whole_numbers(given, "ids");
  if (ids.ndim() != 1) throw Error(EXMAT_INVALID_ARGUMENT, "ids: expected an array of one dimension");
  const std::span<const std::int64_t> span = read_span(ids);
  return made(without_lock([&] { return Points::vertices(model->model, span); }), model);
}

std::shared_ptr<PointsObject> all_vertices(const std::shared_ptr<ModelObject>& model) {
  return made(without_lock([&] { return Points::all_vertices(model->model); }), model);
}

std::shared_ptr<PointsObject> points_at(const std::shared_ptr<ModelObject>& model, const Numbers& xyz) {
  if (xyz.ndim() != 2) throw Error(EXMAT_INVALID_ARGUMENT, "xyz: expected an array of shape (k, 3)");
  require_shape(xyz, "xyz", {xyz.shape(0), 3});
  const std::span<const double> span = read_span(xyz);
  return made(without_lock([&] { return Points::at(model->model, span); }), model);
}

std::shared_ptr<PointsObject> elements(const std::shared_ptr<ModelObject>& model) {
  return made(without_lock([&] { return Points::elements(model->model); }), model);
}

std::vector<std::string> example_names(const ModelObject& model, const RegionName& region) {
  const std::int64_t id = region_of(model.model, region);
  const std::size_t count = id < 0 ? model.examples : model.model.region_examples(static_cast<std::size_t>(id));
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back(model.model.example_name(id, i));
  return names;
}

py::array_t<double> example_pose(const ModelObject& model, const std::string& example, const RegionName& region) {
  const std::vector<std::string> names = example_names(model, region);
  const auto found = std::ranges::find(names, example);
  if (found == names.end())
    throw Error(EXMAT_INVALID_ARGUMENT, ("example: the model has none that is named " + example).c_str());
  const auto number = static_cast<std::size_t>(found - names.begin());
  return array_of(model.model.example_pose(region_of(model.model, region), number), {model.modes});
}

py::array_t<double> animated_bones(const ModelObject& model, const std::string& animation, double time) {
  for (std::size_t i = 0; i < model.model.animations(); ++i)
    if (model.model.animation_name(i) == animation)
      return array_of(model.model.animated_bones(i, time), {model.model.bones(), 3, 4});
  throw Error(EXMAT_INVALID_ARGUMENT, ("animation: the model has none that is named " + animation).c_str());
}

py::tuple elasticity(const ModelObject& model, const Numbers& q) {
  require_shape(q, "q", {static_cast<py::ssize_t>(model.modes)});
  const Elasticity at = model.model.elasticity(read_span(q));
  return py::make_tuple(at.energy, array_of(at.force), array_of(at.tangent, {model.modes, model.modes}));
}

/// As scipy.sparse takes them.
py::tuple compressed_rows(const ModelObject& model, std::int32_t kind) {
  const CompressedRows rows = [&] {
    const py::gil_scoped_release unlocked;
    return model.model.matrix(kind);
  }();
  return py::make_tuple(array_of(rows.values), array_of(rows.columns), array_of(rows.starts));
}

void bind_points(py::module_& module) {
  py::class_<PointsObject, std::shared_ptr<PointsObject>>(
      module, "Points", "k material points of a model's bodies, in the order given; they never change.")
      .def(py::init(&vertices), py::arg("model").none(false), py::arg("ids"),
           "Vertices of the object, 0-based `ids` of shape (k,), k >= 1; repeated ones are allowed.")
      .def_static("all_vertices", &all_vertices, py::arg("model").none(false),
                  "All n vertices of the object. They can be read, not pushed.")
      .def_static("at", &points_at, py::arg("model").none(false), py::arg("xyz"),
                  "Points of the rest shape, `xyz` of shape (k, 3) [m]. Each moves with the tet that holds it, or with "
                  "the nearest one where none does.")
      .def_static("elements", &elements, py::arg("model").none(false), "Centroids of the s cubature elements.")
      .def("__len__", [](const PointsObject& points) { return points.count; })
      .def_property_readonly(
          "model", [](const PointsObject& points) { return points.model.object(); },
          "The model that the points are of.")
      .def_property_readonly(
          "distances", [](const PointsObject& points) { return array_of(points.points.distances(), {points.count}); },
          "From each point to the object at rest, 0 inside: shape (k,) [m]. A copy, as those below.")
      .def_property_readonly(
          "rest",
          [](const PointsObject& points) {
            return array_of(points.points.rest(), {points.count, 3});
          },
          "X, the points at rest: shape (k, 3) [m].")
      .def_property_readonly(
          "basis",
          [](const PointsObject& points) {
            const std::size_t modes = points.model->modes;
            return array_of(points.points.basis(modes), {points.count, 3, modes});
          },
          "U of the points, which are at R (X + U q) + t: shape (k, 3, r), float32 [kg^(-1/2)]. Neither X nor U is "
          "kept for all_vertices().");
}

}  // namespace

std::int64_t region_of(const Model& model, const RegionName& name) {
  if (!name) return -1;
  for (std::size_t i = 0; i < model.regions(); ++i)
    if (model.region_name(i) == *name) return static_cast<std::int64_t>(i);
  throw Error(EXMAT_INVALID_ARGUMENT, ("region: the model has none that is named " + *name).c_str());
}

void bind_model(py::module_& module) {
  py::class_<ModelObject, std::shared_ptr<ModelObject>>(module, "Model", "What exmat.Model stands on.")
      .def(py::init(&of_pack), py::arg("pack"), py::arg("settings"))  // first: bytes would be a path, too
      .def(py::init(&load), py::arg("path"), py::arg("settings"))
      .def(py::init(&of_text), py::arg("scene"), py::arg("path"), py::arg("use_contact"))
      .def_readonly("modes", &ModelObject::modes, "r, the number of modes.")
      .def_property_readonly(
          "vertices", [](const ModelObject& model) { return model.model.vertices(); }, "n, the object's vertices.")
      .def_readonly("examples", &ModelObject::examples,
                    "K, the examples of the whole body, the rest pose counted; 0 without its example force.")
      .def_property_readonly(
          "regions",
          [](const ModelObject& model) {
            py::dict regions;
            for (std::size_t i = 0; i < model.model.regions(); ++i)
              regions[py::str(model.model.region_name(i))] = model.model.region_examples(i);
            return regions;
          },
          "Of each region with an example force of its own, its name and its K, in the scene's order.")
      .def("example_names", &example_names, py::arg("region") = py::none(),
           "Names of the examples, of the whole body or of a region by its name, in the order of the weights.")
      .def("example_pose", &example_pose, py::arg("example"), py::arg("region") = py::none(),
           "The pose of an example by its name: q of shape (r,) [kg^(1/2) m]. A copy.")
      .def("elasticity", &elasticity, py::arg("q"),
           "At reduced coordinates `q` of shape (r,): elastic energy [J] as steps take it, its derivative, shape (r,), "
           "and its Hessian, shape (r, r).")
      .def(
          "_mass", [](const ModelObject& model) { return compressed_rows(model, EXMAT_MASS); },
          "Values, columns and starts of rows.")
      .def(
          "_stiffness", [](const ModelObject& model) { return compressed_rows(model, EXMAT_STIFFNESS); },
          "Values, columns and starts of rows.")
      .def_property_readonly(
          "element_weights",
          [](const ModelObject& model) {
            const std::vector<double> weights = model.model.element_weights();
            return array_of(weights, {weights.size()});
          },
          "How many elements of the object each cubature element stands for: shape (s,). A copy.")
      .def_property_readonly(
          "bones",
          [](const ModelObject& model) {
            py::dict bones;
            for (std::size_t i = 0; i < model.model.bones(); ++i) {
              const std::int64_t parent = model.model.bone_parent(i);
              bones[py::str(model.model.bone_name(i))] =
                  parent < 0 ? py::object(py::none())
                             : py::object(py::str(model.model.bone_name(static_cast<std::size_t>(parent))));
            }
            return bones;
          },
          "Of each bone of the skeleton its name and its parent's, None of a root, parents first; empty without one.")
      .def_property_readonly(
          "bound_bones",
          [](const ModelObject& model) {
            const std::size_t bones = model.model.bones();
            return array_of(bones > 0 ? model.model.bound_bones() : std::vector<double>(), {bones, 3, 4});
          },
          "Matrices that take the bones to the world where the mesh is at rest: shape (b, 3, 4), the last column the "
          "joint [m]; none of a model without a skeleton. A copy.")
      .def_property_readonly(
          "animations",
          [](const ModelObject& model) {
            py::dict animations;
            for (std::size_t i = 0; i < model.model.animations(); ++i)
              animations[py::str(model.model.animation_name(i))] = model.model.animation_duration(i);
            return animations;
          },
          "Of each animation of the skeleton its name and its duration [s].")
      .def("animated_bones", &animated_bones, py::arg("animation"), py::arg("time"),
           "The bones at a time [s] of an animation by its name, which is held at its ends: shape (b, 3, 4). A copy.")
      .def_property_readonly(
          "time_step", [](const ModelObject& model) { return model.model.time_step(); }, "[s].")
      .def_readonly("input_sha256", &ModelObject::sha, "What the bundle was made of, 64 hexadecimal digits.");
  bind_points(module);
}

}  // namespace exmat::python
