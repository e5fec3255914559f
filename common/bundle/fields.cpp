#include "common/bundle/fields.h"

#include <algorithm>
#include <map>
#include <set>

#include "common/bundle/file_schemas.h"

namespace exmat {
namespace {

ReducedModel model_of_all_groups() {
  ReducedModel model;
  for (const GroupSchema& group : bundle_schema().groups) add_group(model, group.group);
  model.examples->examples.emplace_back();
  RegionData& region = model.regions.emplace_back();
  region.examples = *model.examples;
  region.targets.emplace();
  region.target_space.emplace();
  region.target_elasticity.emplace();
  region.full_space.emplace();
  return model;
}

// Attributes are named "/object@material".
class FieldLister {
 public:
  void group(std::string_view schema_path, std::string_view) { group_ = schema_path; }

  template <typename T>
  void attribute(std::string_view name, const T& member) {
    const AttributeValue value = to_attribute(member);
    const bool is_text =
        std::holds_alternative<std::string>(value) || std::holds_alternative<std::vector<std::string>>(value);
    const bool is_integer = std::holds_alternative<std::int64_t>(value);
    types[group_ + "@" + std::string(name)] = is_text      ? ElementType::kString
                                              : is_integer ? ElementType::kInt64
                                                           : ElementType::kFloat64;
  }

  template <typename T>
  void dataset(std::string_view name, const T& member) {
    types[group_ + "/" + std::string(name)] = view_of(member).type;
  }

  std::map<std::string, ElementType> types;

 private:
  std::string group_;
};

std::map<std::string, ElementType> entries_of(const FileSchema& schema) {
  std::map<std::string, ElementType> entries;
  for (const auto& attribute : schema.attributes)
    if (std::ranges::find(kHeaderAttributes, attribute.name) == std::end(kHeaderAttributes))
      entries["/@" + attribute.name] = attribute.type;
  for (const auto& group : schema.groups)
    for (const auto& attribute : group.attributes) entries[group.path + "@" + attribute.name] = attribute.type;
  for (const auto& dataset : schema.datasets) entries[dataset.path] = dataset.type;
  return entries;
}

}  // namespace

void add_group(ReducedModel& model, std::string_view group) {
  if (group == "object")
    model.object.emplace();
  else if (group == "shape_space")
    model.shape_space.emplace();
  else if (group == "examples")
    model.examples.emplace();
  else if (group == "modal")
    model.modal.emplace();
  else if (group == "cubature")
    model.cubature.emplace();
  else if (group == "polynomial")
    model.polynomial.emplace();
  else if (group == "projection")
    model.projection.emplace();
  else if (group == "targets")
    model.targets.emplace();
  else if (group == "target_space")
    model.target_space.emplace();
  else if (group == "target_elasticity")
    model.target_elasticity.emplace();
  else if (group == "full_space")
    model.full_space.emplace();
  else if (group == "fidelity")
    model.fidelity.emplace();
  else if (group == "regions")
    return;
  else if (group == "rigid")
    model.rigid.emplace();
  else if (group == "contact")
    model.contact.emplace();
  else if (group == "render")
    model.render.emplace();
  else if (group == "skeleton")
    model.skeleton.emplace();
  else
    throw std::logic_error("no member of the model is bound to the group " + std::string(group));
}

std::vector<std::string> binding_faults(const FileSchema& schema) {
  const ReducedModel model = model_of_all_groups();
  FieldLister lister;
  visit_fields(model, lister);
  const auto entries = entries_of(schema);
  std::vector<std::string> faults;
  for (const auto& [path, type] : entries) {
    const auto bound = lister.types.find(path);
    if (bound == lister.types.end())
      faults.push_back(path + " of the schema is bound to no member");
    else if (bound->second != type)
      faults.push_back(path + " of the schema has another type than its member");
  }
  for (const auto& [path, type] : lister.types)
    if (!entries.contains(path)) faults.push_back(path + " is bound to a member but not in the schema");
  return faults;
}

}  // namespace exmat
