#include "common/bundle/bundle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>

#include "common/bundle/fields.h"
#include "common/core/error.h"
#include "tests/common/bundle/field_text.h"
#include "tests/common/bundle/small_model.h"

namespace exmat {
namespace {

using test::read_file;
using test::small_model;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

void expect_equal(const ReducedModel& a, const ReducedModel& b) {
  EXPECT_EQ(test::FieldText(a).fields, test::FieldText(b).fields);
}

std::vector<std::string> datasets_of(const std::vector<ReadRecord>& record) {
  std::vector<std::string> names;
  for (const auto& entry : record) names.push_back(entry.dataset);
  return names;
}

BundleRequest request_for(const Needs& needs, bool constrained, bool step_only, bool positions) {
  return {plan_groups(needs, constrained, 3, 2, true, true), needs.regions, step_only, positions};
}

const Needs kLeastNeeds{.examples = false,
                        .contact = false,
                        .render = false,
                        .regions = std::vector<RegionNeeds>{},
                        .internal_force = ForceMethod::kCubature};

class BundleOfEachKind : public ::testing::TestWithParam<std::pair<bool, bool>> {};

TEST_P(BundleOfEachKind, IsReadAsItWasWritten) {
  const TemporaryFolder folder;
  const ReducedModel model = small_model(GetParam().first, GetParam().second);
  write_bundle(model, folder / "a.h5");
  expect_equal(read_bundle(folder / "a.h5"), model);
  EXPECT_THAT(validate_bundle(folder / "a.h5"), IsEmpty());
  EXPECT_EQ(folder.size(), 1u);
}

INSTANTIATE_TEST_SUITE_P(ConstrainedAndExamples, BundleOfEachKind,
                         ::testing::Values(std::pair{true, true}, std::pair{true, false}, std::pair{false, true},
                                           std::pair{false, false}));

TEST(Bundle, HasTheSameBytesForTheSameModel) {
  const TemporaryFolder folder;
  write_bundle(small_model(false), folder / "a.h5");
  {
    // Other contents of the heap, and another order of files.
    std::vector<std::string> noise(1000, std::string(777, 'x'));
    write_bundle(small_model(true), folder / "noise.h5");
  }
  write_bundle(small_model(false), folder / "b.h5");
  EXPECT_TRUE(read_file(folder / "a.h5") == read_file(folder / "b.h5"));
}

TEST(Bundle, ReplacesAnOlderOne) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  write_bundle(small_model(false), folder / "a.h5");
  EXPECT_FALSE(summarise_bundle(folder / "a.h5").constrained);
}

TEST(Bundle, ForSteppingReadsOnlyWhatStepsNeed) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  std::vector<ReadRecord> record;
  const auto model = read_bundle(folder / "a.h5", request_for(kLeastNeeds, true, true, false), &record);
  EXPECT_THAT(datasets_of(record),
              ElementsAre("/modal/gravity_load", "/cubature/weights", "/cubature/volumes", "/cubature/gradient",
                          "/cubature/youngs_modulus", "/cubature/poisson_ratio", "/cubature/variance"));
  EXPECT_EQ(record[0].bytes, 3u * 2u * 8u);
  EXPECT_FALSE(model.examples || model.shape_space || model.polynomial || model.projection || model.targets ||
               model.rigid || model.contact || model.render);
  EXPECT_EQ(model.object->mesh.vertices.rows(), 0);
  EXPECT_EQ(model.modal->basis.rows(), 0);
  EXPECT_EQ(model.object->materials.model, MaterialModel::kCorotational);
}

TEST(Bundle, ForPositionsReadsMeshAndBasisToo) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  std::vector<ReadRecord> record;
  read_bundle(folder / "a.h5", request_for(kLeastNeeds, true, true, true), &record);
  EXPECT_THAT(datasets_of(record),
              ElementsAre("/object/vertices", "/object/tets", "/object/density", "/modal/basis", "/modal/gravity_load",
                          "/cubature/weights", "/cubature/volumes", "/cubature/gradient", "/cubature/youngs_modulus",
                          "/cubature/poisson_ratio", "/cubature/variance"));
}

TEST(Bundle, ForARenderMeshReadsWhatItMovesWith) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  Needs needs = kLeastNeeds;
  needs.render = true;
  std::vector<ReadRecord> record;
  const auto model = read_bundle(folder / "a.h5", request_for(needs, true, true, true), &record);
  const auto datasets = datasets_of(record);
  EXPECT_THAT(std::vector(datasets.end() - 3, datasets.end()),
              ElementsAre("/render/tets", "/render/barycentric", "/render/triangles"));
  EXPECT_EQ(model.render->barycentric, small_model().render->barycentric);
  EXPECT_EQ(model.render->outside, 1);
}

TEST(Bundle, ForExampleForcesReadsTheirProblem) {
  const TemporaryFolder folder;
  write_bundle(small_model(false), folder / "a.h5");
  std::vector<ReadRecord> record;
  const auto model = read_bundle(folder / "a.h5", request_for({}, false, true, false), &record);
  ASSERT_EQ(model.examples->examples.size(), 3u);
  EXPECT_EQ(model.examples->examples[0].name, "z rest");
  EXPECT_EQ(model.examples->examples[2].index, 2);
  EXPECT_EQ(model.examples->gram, small_model().examples->gram);
  EXPECT_EQ(model.examples->examples[0].descriptor.size(), 0);
  EXPECT_THAT(datasets_of(record),
              ::testing::IsSupersetOf({"/examples/bend/reduced", "/polynomial/quartic", "/targets/exponents",
                                       "/targets/control_points", "/targets/knots"}));
  EXPECT_EQ(record.back().dataset, "/contact/basis");
}

TEST(Bundle, ForRegionsReadsThoseThatAreNamed) {
  const TemporaryFolder folder;
  write_bundle(small_model(false), folder / "a.h5");
  Needs needs = kLeastNeeds;
  needs.regions = {{"left", false}};
  std::vector<ReadRecord> record;
  const auto model = read_bundle(folder / "a.h5", request_for(needs, false, true, false), &record);
  ASSERT_EQ(model.regions.size(), 1U);
  EXPECT_FALSE(model.regions[0].targets);
  EXPECT_EQ(model.regions[0].examples.gram, small_model().examples->gram);
  EXPECT_THAT(datasets_of(record), ::testing::Contains("/regions/left/examples/bend/pose"));
  EXPECT_THAT(datasets_of(record), ::testing::Not(::testing::Contains(HasSubstr("far right"))));
  EXPECT_THAT(datasets_of(record), ::testing::Not(::testing::Contains(HasSubstr("/examples/z rest/descriptor"))));
  needs.regions = {{"middle", true}};
  try {
    read_bundle(folder / "a.h5", request_for(needs, false, true, false));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("a.h5: /regions/middle: expected the group"));
    EXPECT_THAT(error.what(), HasSubstr("found the regions far right, left"));
  }
}

TEST(Bundle, NamesAGroupThatIsMissing) {
  const TemporaryFolder folder;
  write_bundle(small_model(true, false), folder / "a.h5");
  try {
    read_bundle(folder / "a.h5", request_for({}, true, true, false));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("a.h5: /shape_space: expected the group (an example force is asked for), found none"));
    EXPECT_THAT(error.what(), HasSubstr("--scene"));
    EXPECT_THAT(error.what(), HasSubstr("needs"));
  }
}

TEST(Bundle, IsSummarised) {
  const TemporaryFolder folder;
  write_bundle(small_model(false), folder / "a.h5");
  const BundleSummary summary = summarise_bundle(folder / "a.h5");
  EXPECT_EQ(summary.asset_name, "small");
  EXPECT_EQ(summary.generator, "exmat test");
  EXPECT_EQ(summary.input_sha256, std::string(64, 'a'));
  EXPECT_FALSE(summary.constrained);
  EXPECT_THAT(summary.groups, ElementsAre("object", "shape_space", "examples", "modal", "cubature", "polynomial",
                                          "projection", "targets", "target_space", "target_elasticity", "full_space",
                                          "fidelity", "regions", "rigid", "contact", "render", "skeleton"));
  EXPECT_EQ(summary.render_vertices, 3);
  ASSERT_EQ(summary.regions.size(), 2U);
  EXPECT_EQ(summary.regions[0].name, "far right");
  EXPECT_EQ(summary.regions[0].examples, 2);
  EXPECT_FALSE(summary.regions[0].has_targets);
  EXPECT_EQ(summary.regions[1].energy_reference, EnergyReference::kRest);
  EXPECT_EQ(summary.vertices, 5);
  EXPECT_EQ(summary.tets, 2);
  EXPECT_EQ(summary.modes, 2);
  EXPECT_EQ(summary.cubature_elements, 2);
  EXPECT_EQ(summary.eigenfunctions, 2);
  EXPECT_EQ(summary.examples, 3);
  EXPECT_TRUE(summary.has_polynomial && summary.has_targets);
  EXPECT_EQ(summary.internal_force, ForceMethod::kPolynomial);
  EXPECT_EQ(summary.energy_reference, EnergyReference::kRest);
}

TEST(FitNeeds, TakesTheBundlesInternalForceAndItsTargetsOfTheSameEnergy) {
  BundleSummary summary;
  summary.internal_force = ForceMethod::kPolynomial;
  summary.energy_reference = EnergyReference::kRest;
  summary.has_targets = true;
  EXPECT_EQ(fit_needs({}, summary).internal_force, ForceMethod::kPolynomial);
  EXPECT_EQ(fit_needs({.internal_force = ForceMethod::kCubature}, summary).internal_force, ForceMethod::kCubature);
  EXPECT_FALSE(fit_needs({.energy_reference = EnergyReference::kExample}, summary).targets);
  EXPECT_TRUE(fit_needs({.energy_reference = EnergyReference::kRest}, summary).targets);
  EXPECT_FALSE(fit_needs({.targets = false, .energy_reference = EnergyReference::kRest}, summary).targets);
  summary.has_targets = false;
  EXPECT_FALSE(fit_needs({.energy_reference = EnergyReference::kRest}, summary).targets);
}

TEST(FitNeeds, TakesTheSpaceOfTargetsWhereNoTableServes) {
  BundleSummary summary;
  summary.energy_reference = EnergyReference::kRest;
  summary.has_targets = summary.has_target_space = true;
  EXPECT_FALSE(fit_needs({.energy_reference = EnergyReference::kRest}, summary).target_space);
  EXPECT_TRUE(fit_needs({.energy_reference = EnergyReference::kExample}, summary).target_space);
  EXPECT_TRUE(fit_needs({.targets = false, .energy_reference = EnergyReference::kRest}, summary).target_space);
  summary.has_target_space = false;  // of formats before 7
  EXPECT_FALSE(fit_needs({.targets = false, .energy_reference = EnergyReference::kRest}, summary).target_space);
}

TEST(Bundle, GivesSomeRowsOfTheBasis) {
  const TemporaryFolder folder;
  const ReducedModel model = small_model();
  write_bundle(model, folder / "a.h5");
  std::vector<ReadRecord> record;
  const std::vector<std::int64_t> vertices = {4, 1, 4};
  const RowMatrix rows = read_basis_rows(folder / "a.h5", vertices, &record);
  ASSERT_EQ(rows.rows(), 9);
  EXPECT_EQ(rows.topRows(3), model.modal->basis.middleRows(12, 3));
  EXPECT_EQ(rows.middleRows(3, 3), model.modal->basis.middleRows(3, 3));
  EXPECT_EQ(rows.bottomRows(3), model.modal->basis.middleRows(12, 3));
  ASSERT_EQ(record.size(), 1u);
  EXPECT_EQ(record[0].bytes, 9u * 2u * 8u);
}

TEST(Bundle, RefusesRowsOfNoVertex) {
  const TemporaryFolder folder;
  write_bundle(small_model(), folder / "a.h5");
  for (const std::int64_t vertex : {std::int64_t{-1}, std::int64_t{5}}) {
    try {
      read_basis_rows(folder / "a.h5", std::span(&vertex, 1));
      FAIL();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("/modal/basis: expected vertex ids from 0 to 4, found " + std::to_string(vertex)));
    }
  }
}

TEST(Bundle, ReadsAnEmptyListOfPoses) {
  const TemporaryFolder folder;
  ReducedModel model = small_model();
  model.cubature->heldout_poses.resize(0, 2);
  write_bundle(model, folder / "a.h5");
  expect_equal(read_bundle(folder / "a.h5"), model);
}

TEST(Bundle, RefusesShiftsOfOtherExamples) {
  const TemporaryFolder folder;
  const auto refusal = [&](Eigen::Index examples, Eigen::Index numbers, Eigen::Index of_full) -> std::string {
    ReducedModel model = small_model(false);
    model.skeleton->shifts = RowMatrix::Zero(examples * model.object->mesh.vertex_count(), 3);
    model.full_space->shifts = RowMatrix::Zero(of_full, numbers);
    write_bundle(model, folder / "a.h5");
    try {
      read_bundle(folder / "a.h5");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const Eigen::Index numbers = small_model(false).full_space->slopes.cols();
  EXPECT_EQ(refusal(3, numbers, 3), "");
  EXPECT_EQ(refusal(0, 0, 0), "");
  EXPECT_THAT(refusal(2, numbers, 2), HasSubstr("/full_space/shifts: expected 3 x "));
  EXPECT_THAT(refusal(3, numbers - 1, 3), HasSubstr("/full_space/shifts: expected 3 x "));
  EXPECT_THAT(refusal(2, numbers, 3), HasSubstr("/skeleton/shifts: expected 3 examples, as /full_space/shifts has, "
                                                "found 2"));
}

TEST(LedgerBytes, AreThoseOfTheDatasets) {
  const TemporaryFolder folder;
  const ReducedModel model = small_model(true);
  auto ledger = plan_groups({}, true, 3);
  fill_bytes(model, ledger);
  write_bundle(model, folder / "a.h5");
  std::vector<ReadRecord> record;
  read_bundle(folder / "a.h5", {.groups = ledger}, &record);
  std::map<std::string, std::size_t> expected;
  for (const auto& [dataset, bytes] : record) expected[dataset.substr(1, dataset.find('/', 1) - 1)] += bytes;
  for (const LedgerEntry& entry : ledger) EXPECT_EQ(entry.bytes, expected[entry.group]) << entry.group;
}

struct BadModel {
  const char* name;
  std::function<void(ReducedModel&)> spoil;
  const char* message;
};
void PrintTo(const BadModel& bad, std::ostream* stream) { *stream << bad.name; }

class UnsoundModel : public ::testing::TestWithParam<BadModel> {};

TEST_P(UnsoundModel, IsNotWritten) {
  const TemporaryFolder folder;
  write_bundle(small_model(), folder / "a.h5");
  const std::string before = read_file(folder / "a.h5");
  ReducedModel model = small_model();
  GetParam().spoil(model);
  try {
    write_bundle(model, folder / "a.h5");
    FAIL();
  } catch (const WorkError& error) {
    EXPECT_THAT(error.what(), HasSubstr("a.h5: "));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
  }
  EXPECT_TRUE(read_file(folder / "a.h5") == before);
  EXPECT_EQ(folder.size(), 1u);
}

const BadModel kBadModels[] = {
    {"NotFinite", [](ReducedModel& model) { model.modal->basis(7, 1) = NAN; },
     "/modal/basis: expected finite numbers, found nan at [2][1][1]"},
    {"SizesDiffer", [](ReducedModel& model) { model.modal->gravity_load.resize(3, 4); },
     "/modal/gravity_load: expected 3 x r (r = 2 from /examples/hq), found a matrix of 3 x 4"},
    {"WrongRows", [](ReducedModel& model) { model.cubature->gradient.conservativeResize(17, 2); },
     "/cubature/gradient: expected 2 x 9 x 2, found a matrix of 17 x 2"},
    {"ExampleNamedAsADataset", [](ReducedModel& model) { model.examples->examples[1].name = "gram"; },
     "/examples/gram"},
    {"ExampleTwice", [](ReducedModel& model) { model.examples->examples[1].name = "z rest"; }, "/examples/z rest"},
    {"NoVolume", [](ReducedModel& model) { model.shape_space->volume = 0; },
     "/shape_space@volume: expected a number > 0, found 0"},
    {"AutoAsTheMethodOfABundle", [](ReducedModel& model) { model.cubature->internal_force = ForceMethod::kAuto; },
     "/cubature@internal_force: expected \"cubature\" or \"polynomial\", found \"auto\""},
};
INSTANTIATE_TEST_SUITE_P(Each, UnsoundModel, ::testing::ValuesIn(kBadModels),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace exmat
