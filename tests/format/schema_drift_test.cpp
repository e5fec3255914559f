#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "common/bundle/bundle.h"
#include "common/bundle/fields.h"
#include "common/bundle/file_schemas.h"
#include "common/config/embedded_schema.h"
#include "common/hdf5/hdf5_file.h"
#include "common/hdf5/schema.h"
#include "tests/common/bundle/small_model.h"

namespace exmat {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Json = nlohmann::json;

TEST(BundleSchema, IsBoundToTheModelEntryByEntry) { EXPECT_THAT(binding_faults(bundle_schema()), IsEmpty()); }

TEST(BundleSchema, IsCaughtWithAnEntryThatIsNotBound) {
  FileSchema schema = bundle_schema();
  schema.datasets.push_back(schema.dataset("/modal/basis"));
  schema.datasets.back().path = "/modal/planted";
  EXPECT_THAT(binding_faults(schema), ElementsAre("/modal/planted of the schema is bound to no member"));
}

TEST(BundleSchema, IsCaughtWithoutAnEntryThatIsBound) {
  FileSchema schema = bundle_schema();
  std::erase_if(schema.datasets, [](const DatasetSchema& dataset) { return dataset.path == "/modal/basis"; });
  schema.groups.front().attributes.clear();
  EXPECT_THAT(binding_faults(schema),
              ElementsAre("/modal/basis is bound to a member but not in the schema",
                          "/object@formulation is bound to a member but not in the schema",
                          "/object@material is bound to a member but not in the schema",
                          "/object@stiffness_ratio is bound to a member but not in the schema",
                          "/object@thin_share is bound to a member but not in the schema",
                          "/object@variance_factor is bound to a member but not in the schema",
                          "/object@worst_stiffness is bound to a member but not in the schema"));
}

TEST(BundleSchema, IsCaughtWithAnotherType) {
  FileSchema schema = bundle_schema();
  schema.datasets.front().type = ElementType::kFloat32;
  EXPECT_THAT(binding_faults(schema), ElementsAre("/object/vertices of the schema has another type than its member"));
}

TEST(BundleSchema, ListsTheGroupsOfTheLedgerInOrder) {
  std::vector<std::string> ledger, schema;
  for (const LedgerEntry& entry : plan_groups({}, false, 3)) ledger.push_back(entry.group);
  for (const GroupSchema& group : bundle_schema().groups)
    if (schema.empty() || schema.back() != group.group) schema.push_back(group.group);
  EXPECT_EQ(schema, ledger);
}

std::set<std::string> datasets_of(const Hdf5File& file, const std::string& group) {
  std::set<std::string> paths;
  for (const std::string& name : file.list(group)) {
    const std::string path = (group == "/" ? "" : group) + "/" + name;
    if (file.has_group(path))
      paths.merge(datasets_of(file, path));
    else
      paths.insert(path);
  }
  return paths;
}

// A path of the schema with all names of a model filled in.
std::vector<std::string> paths_of(const std::string& schema_path, const ReducedModel& model) {
  std::vector<std::string> paths;
  const auto add = [&](const std::string& path, const ExampleSet& set) {
    for (const ExampleData& example : set.examples) paths.push_back(fill_name(path, kExamplePlaceholder, example.name));
  };
  if (!schema_path.starts_with("/regions/")) add(schema_path, *model.examples);
  const auto is_of = [&](const char* group) { return schema_path.find(group) != std::string::npos; };
  for (const RegionData& region : model.regions)
    if (schema_path.starts_with("/regions/") && (region.targets || !is_of("/targets")) &&
        (region.full_space || !is_of("/full_space")))
      add(fill_name(schema_path, kRegionPlaceholder, region.name), region.examples);
  return paths;
}

TEST(WrittenBundle, HoldsExactlyTheSchemasDatasets) {
  const test::TemporaryFolder folder;
  ReducedModel model = test::small_model(false);
  write_bundle(model, folder / "a.h5");
  std::set<std::string> expected;
  for (const DatasetSchema& dataset : bundle_schema().datasets)
    for (const std::string& path : paths_of(dataset.path, model)) expected.insert(path);
  const auto file = Hdf5File::open(folder / "a.h5");
  EXPECT_EQ(datasets_of(file, "/"), expected);
  for (const GroupSchema& group : bundle_schema().groups)
    for (const AttributeSchema& attribute : group.attributes)
      for (const std::string& path : paths_of(group.path, model))
        EXPECT_TRUE(file.has_attribute(path, attribute.name)) << path << attribute.name;
  for (const AttributeSchema& attribute : bundle_schema().attributes)
    EXPECT_TRUE(file.has_attribute("/", attribute.name));
}

// Expects the schema to list for a choice what the programs know of it.
template <typename Choice>
void expect_names(const char* schema, const char* pointer) {
  const Json listed = Json::parse(embedded_schema(schema)).at(Json::json_pointer(pointer));
  EXPECT_EQ(listed, Json(kNames<Choice>)) << schema << pointer;
}

TEST(Choices, AreThoseOfTheAsset) {
  expect_names<MaterialModel>("asset", "/properties/object/properties/material/properties/model/enum");
  expect_names<Weighting>("asset", "/properties/shape_space/properties/weighting/enum");
  expect_names<AlignmentMethod>("asset", "/properties/alignment/properties/method/enum");
  expect_names<AlignmentFrame>("asset", "/properties/alignment/properties/frame/enum");
  expect_names<CubatureMethod>("asset", "/properties/cubature/properties/method/enum");
  expect_names<ForceMethod>("asset", "/properties/internal_force/enum");
  expect_names<Training>("asset", "/properties/basis/properties/training/enum");
}

TEST(Choices, AreThoseOfTheScene) {
  expect_names<Integrator>("scene", "/properties/integrator/enum");
  expect_names<ForceMethod>("scene", "/properties/internal_force/enum");
  expect_names<AttachmentKind>("scene", "/properties/attachments/items/properties/kind/enum");
  for (const std::string examples : {"/properties/examples", "/properties/regions/items"}) {
    expect_names<TargetSource>("scene", (examples + "/properties/target/enum").c_str());
    expect_names<EnergyReference>("scene", (examples + "/properties/energy_reference/enum").c_str());
  }
}

// Notes each text that the schema lets a choice have and the programs do not know.
class ChoiceCheck {
 public:
  void group(std::string_view schema_path, std::string_view) { group_ = schema_path; }
  template <typename T>
  void attribute(std::string_view name, const T&) {
    if constexpr (Named<T>) {
      ++choices;
      const auto& attributes = bundle_schema().group(group_).attributes;
      const auto schema = std::ranges::find(attributes, name, &AttributeSchema::name);
      ASSERT_EQ(schema->constraints.size(), 1U);
      std::istringstream listed(schema->constraints.front().argument);
      for (std::string text; std::getline(listed, text, '|');) EXPECT_TRUE(from_name<T>(text)) << name << text;
    }
  }
  template <typename T>
  void dataset(std::string_view, const T&) {}

  int choices = 0;

 private:
  std::string group_;
};

TEST(Choices, AreThoseOfTheBundle) {
  ChoiceCheck check;
  const ReducedModel model = test::small_model(false);
  visit_fields(model, check);
  // Material, formulation, weighting, internal force, method, targets of the body and of a region, spaces of targets of
  // the three.
  EXPECT_EQ(check.choices, 10);
}

class FileSchemaOf : public ::testing::TestWithParam<const char*> {
 protected:
  FileSchema schema_ = parse_file_schema(embedded_schema(GetParam()));
};
INSTANTIATE_TEST_SUITE_P(Each, FileSchemaOf, ::testing::Values("bundle", "trajectory"));

TEST_P(FileSchemaOf, NamesOnlyItsSymbolsAndGroups) {
  std::set<std::string> symbols, groups = {""};
  for (const auto& [name, meaning] : schema_.symbols) symbols.insert(name);
  for (const GroupSchema& group : schema_.groups) groups.insert(group.path);
  for (const DatasetSchema& dataset : schema_.datasets) {
    for (const Extent& extent : dataset.dims)
      EXPECT_TRUE(extent.symbol.empty() || symbols.contains(extent.symbol)) << dataset.path << extent.symbol;
    for (const Constraint& constraint : dataset.constraints)
      EXPECT_TRUE(constraint.kind != Constraint::Kind::kIndex || symbols.contains(constraint.argument)) << dataset.path;
    EXPECT_TRUE(groups.contains(dataset.path.substr(0, dataset.path.rfind('/')))) << dataset.path;
  }
}

TEST_P(FileSchemaOf, DescribesEveryEntry) {
  EXPECT_FALSE(schema_.description.empty());
  for (const GroupSchema& group : schema_.groups) {
    EXPECT_FALSE(group.description.empty()) << group.path;
    for (const AttributeSchema& attribute : group.attributes)
      EXPECT_FALSE(attribute.description.empty()) << attribute.name;
  }
  for (const DatasetSchema& dataset : schema_.datasets) {
    EXPECT_FALSE(dataset.description.empty()) << dataset.path;
    const bool is_index = dataset.type == ElementType::kInt32 || dataset.type == ElementType::kUint8;
    EXPECT_EQ(dataset.units.empty(), is_index) << dataset.path;
  }
}

TEST(FileSchemaText, IsRefusedWithAnUnknownTypeUseOrConstraint) {
  const std::string text(embedded_schema("bundle"));
  for (const auto& [from, to] : {std::pair{"\"float64\"", "\"float65\""}, std::pair{"\"step\"", "\"steps\""},
                                 std::pair{"\"poisson\"", "\"fish\""}}) {
    std::string spoilt = text;
    spoilt.replace(spoilt.find(from), std::string(from).size(), to);
    EXPECT_THROW(parse_file_schema(spoilt), std::logic_error) << to;
  }
}

// JSON Schemas: every object closed, every member described, every optional member with a default.
void check_closed(const Json& schema, const std::string& place) {
  const Json type = schema.value("type", Json());
  if (type != "object" && !(type.is_array() && std::find(type.begin(), type.end(), "object") != type.end())) {
    if (schema.contains("items")) check_closed(schema["items"], place + "/items");
    return;
  }
  EXPECT_EQ(schema.value("additionalProperties", true), false) << place;
  const Json required = schema.value("required", Json::array());
  for (const auto& [name, member] : schema.at("properties").items()) {
    const bool is_required = std::find(required.begin(), required.end(), name) != required.end();
    EXPECT_TRUE(member.contains("description")) << place << "/" << name;
    EXPECT_EQ(member.contains("default"), !is_required) << place << "/" << name;
    check_closed(member, place + "/" + name);
  }
}

class ConfigSchema : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Each, ConfigSchema, ::testing::Values("asset", "scene", "skeleton", "study", "viewer_script"));

TEST_P(ConfigSchema, IsClosedAndDescribed) {
  const Json schema = Json::parse(embedded_schema(GetParam()));
  check_closed(schema, "");
  for (const auto& [name, definition] : schema.at("definitions").items()) check_closed(definition, name);
}

}  // namespace
}  // namespace exmat
