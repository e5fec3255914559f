#include <algorithm>
#include <iterator>
#include <optional>
#include <set>

#include "common/bundle/bundle.h"
#include "common/bundle/bundle_reader.h"
#include "common/bundle/file_schemas.h"
#include "common/core/error.h"

namespace exmat {
namespace {

class Validator {
 public:
  explicit Validator(const BundleInput& input) : reader_(input, nullptr, &problems_) {}

  std::vector<std::string> run() {
    reader_.attempt([&] { check(); });
    return problems_;
  }

 private:
  void check() {
    const ReducedModel model = reader_.read({.groups = reader_.listed_groups()});
    reader_.attempt([&] { collect_known(model); });
    for (const auto& [path, schema] : datasets_)
      if (reader_.file().describes_itself())
        reader_.attempt([&, &path = path, schema = schema] { check_labels(path, *schema); });
    reader_.attempt([&] { check_features(); });
    reader_.attempt([&] { check_extras("/"); });
  }

  // Paths in the file that the schema knows, of the groups that were found.
  void collect_known(const ReducedModel& model) {
    for (const GroupSchema& group : bundle_schema().groups)
      for (const std::string& path : instances(group.path, model)) groups_.insert(path);
    for (const DatasetSchema& dataset : bundle_schema().datasets)
      for (const std::string& path : instances(dataset.path, model))
        if (reader_.file().has_dataset(path)) datasets_.emplace_back(path, &dataset);
    for (const auto& [path, schema] : datasets_) known_.insert(path);
  }

  static std::vector<std::string> instances(const std::string& schema_path, const ReducedModel& model) {
    if (schema_path.find(kRegionPlaceholder) == std::string::npos)
      return of_examples(schema_path, model.examples.value_or(ExampleSet{}));
    std::vector<std::string> paths;
    for (const RegionData& region : model.regions)
      std::ranges::copy(of_examples(fill_name(schema_path, kRegionPlaceholder, region.name), region.examples),
                        std::back_inserter(paths));
    return paths;
  }

  static std::vector<std::string> of_examples(const std::string& path, const ExampleSet& set) {
    if (path.find(kExamplePlaceholder) == std::string::npos) return {path};
    std::vector<std::string> paths;
    for (const ExampleData& example : set.examples) paths.push_back(fill_name(path, kExamplePlaceholder, example.name));
    return paths;
  }

  void check_labels(const std::string& path, const DatasetSchema& schema) {
    const std::pair<const char*, const std::string*> labels[] = {
        {"description", &schema.description}, {"units", &schema.units}, {"dims", &schema.dims_text}};
    for (const auto& [name, expected] : labels) {
      const AttributeValue value = reader_.file().read_attribute(path, name);
      const auto* text = std::get_if<std::string>(&value);
      if (text == nullptr || *text != *expected)
        note(path + "@" + name, "\"" + *expected + "\"", text == nullptr ? "no text" : "\"" + *text + "\"");
    }
  }

  void check_features() {
    const auto always = plan_groups(
        {.examples = false, .rigid = false, .contact = false, .internal_force = ForceMethod::kCubature}, true, 0);
    for (const LedgerEntry& entry : reader_.listed_groups()) {
      if (entry.included) continue;
      const bool is_present = reader_.file().has_group("/" + entry.group);
      if (is_present) note("/@features", "\"" + entry.group + "\", which the file holds", "a list without it");
      if (!is_present && includes(always, entry.group))
        note("/" + entry.group, "the group, which every bundle holds", "none");
    }
    const auto& features = reader_.features();
    const std::string body = reader_.constrained() ? "constrained" : "free";
    if (std::ranges::find(features, body) == features.end())
      note("/@features", "\"" + body + "\"", "a list without it");
  }

  // Reports what the schema does not know; unknown groups are named once, not entered.
  void check_extras(const std::string& group) {
    for (const std::string& name : reader_.file().list(group)) {
      const std::string path = group == "/" ? "/" + name : group + "/" + name;
      if (groups_.contains(path))
        check_extras(path);
      else if (!known_.contains(path))
        note(path, "only what this version of the format has", "an unknown entry");
    }
  }

  void note(const std::string& place, const std::string& expected, const std::string& found) {
    problems_.push_back(to_string({reader_.file().name(), place, expected, found, ""}));
  }

  std::vector<std::string> problems_;
  BundleReader reader_;
  std::vector<std::pair<std::string, const DatasetSchema*>> datasets_;
  std::set<std::string> known_, groups_;
};

}  // namespace

std::vector<std::string> validate_bundle(const BundleInput& input) {
  try {
    return Validator(input).run();
  } catch (const InputError& error) {
    return {error.what()};
  }
}

}  // namespace exmat
