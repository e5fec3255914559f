#include "common/bundle/bundle_reader.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <span>

#include "common/bundle/file_schemas.h"
#include "common/bundle/table_checks.h"
#include "common/core/crc32.h"
#include "common/core/error.h"
#include "common/hdf5/value_checks.h"
#include "common/mesh/elements.h"

namespace exmat {
namespace {

const AttributeSchema& find_attribute(const std::vector<AttributeSchema>& attributes, std::string_view name) {
  const auto found = std::ranges::find(attributes, name, &AttributeSchema::name);
  if (found == attributes.end()) throw std::logic_error(fmt::format("attribute {} is not in the schema", name));
  return *found;
}

// Member of an asset that brings a group.
std::string asset_member(std::string_view group) {
  if (group == "polynomial") return "\"polynomial\" as internal_force";
  if (group == "render") return "object.render_mesh";
  const bool is_need = group == "targets" || group == "target_elasticity" || group == "full_space" ||
                       group == "rigid" || group == "contact" || group == "regions";
  return fmt::format("\"{}\" among the needs", is_need ? group : "examples");
}

std::string size_text(std::span<const std::int64_t> sizes) {
  return sizes.empty() ? "a scalar" : fmt::format("{}", fmt::join(sizes, " x "));
}

}  // namespace

BundleReader::BundleReader(const BundleInput& input, std::vector<ReadRecord>* record,
                           std::vector<std::string>* problems)
    : file_(open_bundle(input)), record_(record), problems_(problems) {
  read_header();
}

void BundleReader::read_header() {
  header_value("format");
  const auto version = std::get<std::int64_t>(header_value("format_version"));
  if (version != bundle_schema().format_version)
    refuse("/@format_version", fmt::format("{}", bundle_schema().format_version), fmt::format("{}", version),
           fmt::format("a version of exmat that is {} wrote this bundle; make it again with this one",
                       version < bundle_schema().format_version ? "older" : "newer"));
  features_ = std::get<std::vector<std::string>>(header_value("features"));
  constrained_ = std::get<std::int64_t>(header_value("constrained")) != 0;
}

AttributeValue BundleReader::header_value(std::string_view name) const {
  const AttributeSchema& schema = find_attribute(bundle_schema().attributes, name);
  AttributeValue value = file_->read_attribute("/", schema.name);
  if (const auto fault = check_value(schema, value, sizes_)) refuse("/@" + schema.name, fault->expected, fault->found);
  return value;
}

std::string BundleReader::text_attribute(const std::string& name) const {
  return std::get<std::string>(header_value(name));
}

std::vector<LedgerEntry> BundleReader::listed_groups() const {
  std::vector<LedgerEntry> ledger = plan_groups(Needs{}, constrained_, 0);
  for (LedgerEntry& entry : ledger) {
    entry.included = std::ranges::find(features_, entry.group) != features_.end();
    entry.reason = "the root attribute features lists it";
  }
  return ledger;
}

std::vector<std::string> BundleReader::example_names(const std::string& folder) const {
  std::vector<std::string> names;
  for (std::string& name : file_->list(folder))
    if (std::ranges::find(kExampleDatasets, name) == std::end(kExampleDatasets) &&
        file_->has_group(folder + "/" + name))
      names.push_back(std::move(name));
  return names;
}

std::vector<std::string> BundleReader::region_names() const {
  std::vector<std::string> names;
  for (std::string& name : file_->list("/regions"))
    if (file_->has_group("/regions/" + name)) names.push_back(std::move(name));
  return names;
}

void BundleReader::add_examples(const std::string& folder, ExampleSet& set) const {
  if (!file_->has_group(folder)) refuse(folder, "the group", "none");
  for (const std::string& name : example_names(folder)) set.examples.emplace_back().name = name;
}

void BundleReader::add_regions(ReducedModel& model) const {
  const auto names = region_names();
  const auto add = [&](const RegionNeeds& needs) {
    const std::string path = "/regions/" + needs.name;
    if (std::ranges::find(names, needs.name) == names.end())
      refuse(path, "the group (the scene names this region)",
             names.empty() ? "none" : fmt::format("the regions {}", fmt::join(names, ", ")));
    RegionData region;
    region.name = needs.name;
    add_examples(path + "/examples", region.examples);
    if (needs.targets && file_->has_group(path + "/targets")) region.targets.emplace();
    if (needs.target_space && file_->has_group(path + "/target_space")) region.target_space.emplace();
    if (needs.target_elasticity && file_->has_group(path + "/target_elasticity")) region.target_elasticity.emplace();
    if (needs.full_space && file_->has_group(path + "/full_space")) region.full_space.emplace();
    model.regions.push_back(std::move(region));
  };
  if (request_.regions)
    std::ranges::for_each(*request_.regions, add);
  else
    for (const std::string& name : names) add({.name = name, .target_elasticity = true});
}

ReducedModel BundleReader::read(const BundleRequest& request) {
  request_ = request;
  ReducedModel model;
  for (const LedgerEntry& entry : request.groups) {
    if (!entry.included) continue;
    attempt([&] {
      require_group(entry);
      add_group(model, entry.group);
    });
  }
  if (model.examples) attempt([&] { add_examples("/examples", *model.examples); });
  attempt([&] {
    if (includes(request.groups, "regions") && file_->has_group("/regions")) add_regions(model);
  });
  visit_fields(model, *this);
  check_model(model);
  if (model.examples) std::ranges::stable_sort(model.examples->examples, {}, &ExampleData::index);
  for (RegionData& region : model.regions) std::ranges::stable_sort(region.examples.examples, {}, &ExampleData::index);
  std::ranges::stable_sort(model.regions, {}, &RegionData::index);
  return model;
}

void BundleReader::require_group(const LedgerEntry& entry) const {
  const std::string path = "/" + entry.group;
  if (file_->has_group(path)) return;
  refuse(path, fmt::format("the group ({})", entry.reason), "none",
         fmt::format("precompute the bundle again, with --scene SCENE.json or with {} of the asset",
                     asset_member(entry.group)));
}

std::unique_ptr<StoredArray> BundleReader::open_checked(const DatasetSchema& schema, const std::string& path) {
  auto opened = file_->open_dataset(path);
  const StoredArray& dataset = *opened;
  if (dataset.type() != schema.type) refuse(path, std::string(name_of(schema.type)), dataset.type_name());
  dataset.check_storage();
  if (const auto expected = sizes_.bind(schema.dims, dataset.sizes(), path))
    refuse(path, *expected, size_text(dataset.sizes()));
  const bool may_be_empty = std::ranges::find(schema.constraints, Constraint::Kind::kMayBeEmpty, &Constraint::kind) !=
                            schema.constraints.end();
  if (dataset.element_count() == 0 && !may_be_empty) refuse(path, "some elements", size_text(dataset.sizes()));
  if (!dataset.is_held()) return opened;
  // Links of several names to the same data take no place in the file.
  bytes_opened_ += dataset.element_count() * size_of(schema.type);
  if (bytes_opened_ > file_->capacity())
    refuse(path, fmt::format("{} bytes in all datasets at most, for the size of the file", file_->capacity()),
           fmt::format("{}", bytes_opened_));
  return opened;
}

bool BundleReader::is_left_out(const StoredArray& dataset, const DatasetSchema& schema) const {
  if (dataset.is_held()) return false;
  if (schema.use == Use::kInspect) return true;
  refuse(dataset.path(), "an array, which runs need", "its sizes alone", "make the pack again with exmat-runtime pack");
}

void BundleReader::note(const std::string& dataset, std::size_t bytes) {
  if (record_ != nullptr) record_->push_back({dataset, bytes});
}

void BundleReader::attempt(const std::function<void()>& check) {
  try {
    check();
  } catch (const InputError& error) {
    if (problems_ == nullptr) throw;
    problems_->push_back(error.what());
  }
}

void BundleReader::group(std::string_view schema_path, std::string_view path) {
  schema_path_ = schema_path;
  path_ = path;
  if (schema_path_ == "/") return;
  sizes_.forget(bundle_schema().group(schema_path_).symbols);
  if (schema_path_.ends_with("/examples"))
    attempt([&] { sizes_.set("K", std::ssize(example_names(path_)), "the groups of " + path_); });
}

const AttributeSchema& BundleReader::attribute_schema(std::string_view name) const {
  const auto& attributes =
      schema_path_ == "/" ? bundle_schema().attributes : bundle_schema().group(schema_path_).attributes;
  return find_attribute(attributes, name);
}

AttributeValue BundleReader::read_value(const AttributeSchema& schema) {
  AttributeValue value = file_->read_attribute(path_, schema.name);
  const std::string place = path_ + "@" + schema.name;
  if (const auto fault = check_value(schema, value, sizes_)) refuse(place, fault->expected, fault->found);
  sound_.insert(place);
  return value;
}

const DatasetSchema& BundleReader::schema_of(std::string_view name) const {
  return bundle_schema().dataset(fmt::format("{}/{}", schema_path_, name));
}

bool BundleReader::is_wanted(const DatasetSchema& schema) const {
  if (!request_.step_only || schema.use == Use::kStep) return true;
  if (schema.use == Use::kPositions) return request_.positions || request_.full_space;
  if (schema.use == Use::kLook) return request_.look;
  if (schema.use == Use::kPlaces) return request_.places;
  return request_.full_space && schema.use == Use::kFullSpace;
}

std::pair<std::int64_t, std::int64_t> BundleReader::matrix_sizes(const StoredArray& dataset) {
  const auto& sizes = dataset.sizes();
  if (sizes.size() == 1) return {sizes.front(), 1};
  std::int64_t rows = 1;
  for (std::size_t axis = 0; axis + 1 < sizes.size(); ++axis) rows *= sizes[axis];
  return {rows, sizes.back()};
}

void BundleReader::read_checked(const StoredArray& dataset, const DatasetSchema& schema, void* memory) {
  const std::size_t bytes = dataset.element_count() * size_of(schema.type);
  dataset.read(memory, schema.type);
  note(dataset.path(), bytes);
  const std::int64_t crc = crc32_of({static_cast<const std::byte*>(memory), bytes});
  const std::optional<std::int64_t> stored_crc = file_->checksum(dataset.path());
  const bool intact = stored_crc == crc;
  constexpr const char* kChanged = "the data are damaged or were changed after the bundle was written";
  // The value comes first: it says more.
  if (const auto fault = check_values(schema, dataset.sizes(), memory, sizes_))
    refuse(dataset.path(), fault->expected, fault->found, intact ? "" : kChanged);
  if (!intact)
    refuse(dataset.path(), !stored_crc ? "a checksum" : fmt::format("checksum {:08x}", *stored_crc),
           fmt::format("{:08x}", crc), kChanged);
  sound_.insert(dataset.path());
}

void BundleReader::check_model(const ReducedModel& model) {
  if (model.examples) attempt([&] { check_example_indices("/examples", *model.examples); });
  attempt([&] { check_fixed_vertices(model); });
  if (model.object) attempt([&] { check_marks(*model.object); });
  if (model.targets) check_targets("/targets", *model.targets);
  if (model.render) attempt([&] { check_barycentric(model.render->barycentric); });
  if (model.skeleton) attempt([&] { check_skeleton(*model.skeleton); });
  if (model.render && model.skeleton) attempt([&] { check_bones(model); });
  if (model.skeleton && model.full_space) attempt([&] { check_shifts(model); });
  check_elements(model);
  for (const RegionData& region : model.regions) {
    const std::string path = "/regions/" + region.name;
    attempt([&] { check_example_indices(path + "/examples", region.examples); });
    if (region.targets) check_targets(path + "/targets", *region.targets);
  }
}

void BundleReader::check_targets(const std::string& folder, const TargetTableData& targets) {
  attempt([&] { check_exponents(folder, targets); });
  attempt([&] { check_target_knots(folder, targets); });
}

void BundleReader::check_example_indices(const std::string& folder, const ExampleSet& set) const {
  const auto count = set.examples.size();
  if (count == 0) refuse(folder, "at least the rest pose", "no example");
  std::vector<const ExampleData*> by_index(count, nullptr);
  for (const ExampleData& example : set.examples) {
    const std::string path = folder + "/" + example.name;
    if (!is_sound(path + "@index") || !is_sound(path + "@is_rest")) return;
    const ExampleData*& slot = by_index[static_cast<std::size_t>(example.index)];
    if (slot != nullptr)
      refuse(path + "@index", "another index for each example",
             fmt::format("{}, that of {} too", example.index, slot->name));
    slot = &example;
    if (example.is_rest != (example.index == 0))
      refuse(path + "@is_rest", "1 for index 0 and 0 for all others",
             fmt::format("{} for index {}", example.is_rest ? 1 : 0, example.index));
  }
}

void BundleReader::check_fixed_vertices(const ReducedModel& model) const {
  if (!is_sound("/object/fixed")) return;
  const FlagVector& fixed = model.object->fixed;
  const bool any_fixed = (fixed.array() != 0).any();
  if (any_fixed != constrained_)
    refuse("/@constrained", any_fixed ? "1 (/object/fixed has fixed vertices)" : "0 (/object/fixed has none)",
           constrained_ ? "1" : "0");
  if (!is_sound("/modal/basis")) return;
  for (Eigen::Index v = 0; v < fixed.size(); ++v)
    if (fixed[v] != 0 && !model.modal->basis.middleRows(3 * v, 3).isZero(0))
      refuse("/modal/basis", fmt::format("zeros on vertex {}, fixed by /object/fixed", v), "other numbers");
}

void BundleReader::check_marks(const ObjectData& object) const {
  const auto check_rows = [&](const char* path, Eigen::Index rows) {
    if (is_sound(path) && is_sound("/object/vertices") && rows != 0 && rows != object.mesh.vertex_count())
      refuse(path, fmt::format("{} rows, or none", object.mesh.vertex_count()), fmt::format("{}", rows));
  };
  check_rows("/object/vertex_parts", object.vertex_parts.size());
  check_rows("/object/colours", object.colours.rows());
  const auto names = (object.part_names.array() == 0).count();
  if (is_sound("/object/part_names") && is_sound("/object/part_sets") && names != object.part_sets.cols())
    refuse("/object/part_names", fmt::format("{} names, as /object/part_sets has columns", object.part_sets.cols()),
           fmt::format("{}", names));
}

void BundleReader::check_exponents(const std::string& folder, const TargetTableData& targets) const {
  const std::string path = folder + "/exponents";
  if (!is_sound(path) || !is_sound(folder + "@degree")) return;
  if (const auto fault = check_exponent_rows(targets.degree, targets.exponents))
    refuse(path, fault->expected, fault->found);
}

void BundleReader::check_target_knots(const std::string& folder, const TargetTableData& targets) const {
  const std::string path = folder + "/knots";
  if (!is_sound(path) || !is_sound(folder + "/exponents")) return;
  if (const auto fault = check_knots(targets.knots, targets.exponents.cols()))
    refuse(path, fault->expected, fault->found);
}

// Nothing is checked where the mesh has not been read.
void BundleReader::check_elements(const ReducedModel& model) {
  for (const char* path :
       {"/object@formulation", "/object/vertices", "/object/tets", "/object/youngs_modulus", "/object/poisson_ratio"})
    if (!is_sound(path)) return;
  const ObjectData& object = *model.object;
  const bool linear = object.materials.formulation == Formulation::kLinear;
  const Eigen::Index count = linear ? object.mesh.tet_count() : elements_of(object.mesh, object.materials).count();
  const auto check = [&](const std::string& path, const IndexVector& elements) {
    attempt([&] {
      if (is_sound(path) && elements.maxCoeff() >= count)
        refuse(path, fmt::format("numbers of the {} elements of /object, from 0 on", count),
               std::to_string(elements.maxCoeff()));
    });
  };
  const auto check_targets = [&](const std::string& group, const auto& owner) {
    if (owner.target_space) check(group + "/target_space/elements", owner.target_space->elements);
    if (owner.target_elasticity) check(group + "/target_elasticity/elements", owner.target_elasticity->elements);
  };
  if (model.cubature) check("/cubature/elements", model.cubature->elements);
  check_targets("", model);
  for (const RegionData& region : model.regions) check_targets("/regions/" + region.name, region);
}

void BundleReader::check_barycentric(const RowMatrix& rows) const {
  const std::string path = "/render/barycentric";
  if (!is_sound(path)) return;
  // Rounding grows with the entries of a row, which are large where a vertex is far outside its tet.
  constexpr double kRounding = 1e-9;
  for (Eigen::Index k = 0; k < rows.rows(); ++k)
    if (std::abs(rows.row(k).sum() - 1) > kRounding * rows.row(k).cwiseAbs().sum())
      refuse(path, fmt::format("numbers that add up to 1 in row {}", k), fmt::format("{}", rows.row(k).sum()));
}

void BundleReader::check_skeleton(const SkeletonData& skeleton) const {
  for (const char* path :
       {"/skeleton@bones", "/skeleton@animations", "/skeleton/parents", "/skeleton/bind", "/skeleton/weights",
        "/skeleton/first_frames", "/skeleton/times", "/skeleton/poses", "/skeleton/shifts"})
    if (!is_sound(path)) return;
  if (const auto fault = skeleton_fault(skeleton)) refuse(fault->place, fault->expected, fault->found);
}

void BundleReader::check_bones(const ReducedModel& model) const {
  for (const char* path : {"/render/bones", "/render/bone_weights", "/skeleton/parents"})
    if (!is_sound(path)) return;
  const IndexMatrix& bones = model.render->bones;
  if (bones.size() > 0 && bones.maxCoeff() >= model.skeleton->parents.size())
    refuse("/render/bones", fmt::format("bones below {}", model.skeleton->parents.size()),
           std::to_string(bones.maxCoeff()));
  if (const auto fault = bone_weights_fault("/render/bone_weights", model.render->bone_weights))
    refuse(fault->place, fault->expected, fault->found);
}

void BundleReader::check_shifts(const ReducedModel& model) const {
  for (const char* path : {"/full_space/shifts", "/full_space/slopes", "/skeleton/shifts", "/skeleton/weights"})
    if (!is_sound(path)) return;
  const RowMatrix &slopes = model.full_space->slopes, &shifts = model.full_space->shifts;
  if (shifts.rows() > 0 && (shifts.rows() != slopes.rows() || shifts.cols() != slopes.cols()))
    refuse("/full_space/shifts", fmt::format("{} x {} numbers, or none", slopes.rows(), slopes.cols()),
           fmt::format("{} x {}", shifts.rows(), shifts.cols()));
  const Eigen::Index found = model.skeleton->shifts.rows() / model.skeleton->weights.rows();
  if (found != shifts.rows())
    refuse("/skeleton/shifts", fmt::format("{} examples, as /full_space/shifts has", shifts.rows()),
           fmt::format("{}", found));
}

void BundleReader::refuse(const std::string& place, const std::string& expected, const std::string& found,
                          const std::string& advice) const {
  throw InputError({file_->name(), place, expected, found, advice});
}

}  // namespace exmat
