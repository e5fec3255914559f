#include <functional>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/bundle/table_checks.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "common/hdf5/value_checks.h"
#include "tests/common/bundle/small_model.h"
#include "tests/common/bundle/spoiler.h"

namespace exmat {
namespace {

using test::small_model;
using test::Spoiler;
using test::TemporaryFolder;
using test::write_file;
using ::testing::HasSubstr;

struct BadBundle {
  const char* name;
  std::function<void(Spoiler&)> spoil;
  const char* message;
};
void PrintTo(const BadBundle& bad, std::ostream* stream) { *stream << bad.name; }

class BadBundleIs : public ::testing::TestWithParam<BadBundle> {
 protected:
  BadBundleIs() {
    write_bundle(small_model(false), folder_ / "a.h5");
    Spoiler spoiler(folder_ / "a.h5");
    GetParam().spoil(spoiler);
  }

  TemporaryFolder folder_;
};

TEST_P(BadBundleIs, RefusedByTheReader) {
  try {
    read_bundle(folder_ / "a.h5");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr((folder_ / "a.h5").string() + ": " + GetParam().message));
  }
}

TEST_P(BadBundleIs, ReportedByTheValidator) {
  EXPECT_THAT(validate_bundle(folder_ / "a.h5"), ::testing::Contains(HasSubstr(GetParam().message)));
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void set_exponents(Spoiler& spoiler, const std::vector<std::int32_t>& values) {
  for (std::size_t i = 0; i < values.size(); ++i)
    spoiler.set("/targets/exponents", static_cast<Eigen::Index>(i), values[i]);
}

const BadBundle kBadBundles[] = {
    {"OtherFormat", [](Spoiler& s) { s.set_text("/", "format", "other"); },
     "/@format: expected \"exmat-bundle\", found \"other\""},
    {"NoFormat", [](Spoiler& s) { s.remove_attribute("/", "format"); }, "/@format: expected an attribute, found none"},
    {"NewerVersion", [](Spoiler& s) { s.set_integer("/", "format_version", 19); },
     "/@format_version: expected 18, found 19; a version of exmat that is newer wrote this bundle; make it again"},
    {"OlderVersion", [](Spoiler& s) { s.set_integer("/", "format_version", 8); },
     "/@format_version: expected 18, found 8; a version of exmat that is older wrote this bundle; make it again"},
    {"NoVersion", [](Spoiler& s) { s.set_integer("/", "format_version", 0); },
     "/@format_version: expected a number > 0, found 0"},
    {"TextVersion", [](Spoiler& s) { s.set_text("/", "format_version", "1"); },
     "/@format_version: expected one int64, found a string"},
    {"NoFeatures", [](Spoiler& s) { s.remove_attribute("/", "features"); }, "/@features: expected an attribute"},
    {"NoGenerator", [](Spoiler& s) { s.remove_attribute("/", "generator"); }, "/@generator: expected an attribute"},
    {"WrongConstrained", [](Spoiler& s) { s.set_integer("/", "constrained", 1); },
     "/@constrained: expected 0 (/object/fixed has none), found 1"},
    {"MissingGroup", [](Spoiler& s) { s.remove("/rigid"); },
     "/rigid: expected the group (the root attribute features lists it), found none"},
    {"GroupIsADataset", [](Spoiler& s) { s.replace("/rigid", H5T_NATIVE_DOUBLE, {1}); }, "/rigid: expected the group"},
    {"MissingDataset", [](Spoiler& s) { s.remove("/cubature/weights"); },
     "/cubature/weights: expected a dataset, found nothing of that name"},
    {"MissingExampleDataset", [](Spoiler& s) { s.remove("/examples/bend/reduced"); },
     "/examples/bend/reduced: expected a dataset, found nothing"},
    {"DatasetIsAGroup", [](Spoiler& s) { s.remove("/modal/basis"), s.add_group("/modal/basis"); },
     "/modal/basis: expected a dataset, found another kind of object"},
    {"ExternalLink", [](Spoiler& s) { s.remove("/modal/basis"), s.link_elsewhere("/modal/basis"); },
     "/modal/basis: expected a dataset, found nothing of that name"},
    {"MissingAttribute", [](Spoiler& s) { s.remove_attribute("/shape_space", "volume"); },
     "/shape_space@volume: expected an attribute, found none"},
    {"IntegerForNumber", [](Spoiler& s) { s.set_integer("/shape_space", "volume", 1); },
     "/shape_space@volume: expected one float64, found one int64"},
    {"ShortAttribute",
     [](Spoiler& s) {
       const double two[] = {1, 2};
       s.set_attribute("/shape_space", "centroid", H5T_NATIVE_DOUBLE, two, {2});
     },
     "/shape_space@centroid: expected 3 float64 elements, found 2 float64 elements"},
    {"AttributeOutOfRange", [](Spoiler& s) { s.set_number("/examples/bend", "scale", -1); },
     "/examples/bend@scale: expected a number > 0, found -1"},
    {"AttributeNotFinite", [](Spoiler& s) { s.set_number("/cubature", "heldout_error", kInfinity); },
     "/cubature@heldout_error: expected finite numbers, found inf"},
    {"UnknownWeighting", [](Spoiler& s) { s.set_text("/shape_space", "weighting", "area"); },
     "/shape_space@weighting: expected \"eigenvalue\" or \"none\", found \"area\""},
    {"NoChecksum", [](Spoiler& s) { s.remove_attribute("/modal/basis", "crc32"); },
     "/modal/basis@crc32: expected an attribute, found none"},
    {"WrongChecksum", [](Spoiler& s) { s.set("/modal/basis", 3, 9.5, false); }, "/modal/basis: expected checksum "},
    {"WrongType",
     [](Spoiler& s) {
       s.replace("/modal/basis", H5T_NATIVE_FLOAT, {5, 3, 2});
     },
     "/modal/basis: expected float64, found float32"},
    {"WideIndices",
     [](Spoiler& s) {
       s.replace("/object/tets", H5T_NATIVE_INT64, {2, 4});
     },
     "/object/tets: expected int32, found int64"},
    {"WrongRank",
     [](Spoiler& s) {
       s.replace("/cubature/gradient", H5T_NATIVE_DOUBLE, {18, 2});
     },
     "/cubature/gradient: expected s x 9 x r (s = 2 from /cubature/elements, r = 2 from "},
    {"WrongFixedSize",
     [](Spoiler& s) {
       s.replace("/object/vertices", H5T_NATIVE_DOUBLE, {5, 2});
     },
     "/object/vertices: expected n x 3, found 5 x 2"},
    {"SizesDiffer",
     [](Spoiler& s) {
       s.replace("/modal/basis", H5T_NATIVE_DOUBLE, {4, 3, 2});
     },
     "/modal/basis: expected n x 3 x r (n = 5 from /object/vertices, r = 2 from /examples/hq), found 4 x 3 x 2"},
    {"NotAMultiple",
     [](Spoiler& s) {
       s.replace("/projection/shape_from_reduced", H5T_NATIVE_DOUBLE, {7, 2});
     },
     "/projection/shape_from_reduced: expected 3m x r (m = 2 from /shape_space/eigenvalues, r = 2 from "},
    {"WrongExampleCount", [](Spoiler& s) { s.remove("/examples/bend"); },
     "/examples/gram: expected K x K (K = 2 from the groups of /examples), found 3 x 3"},
    {"TooFewPairs",
     [](Spoiler& s) {
       s.replace("/polynomial/cubic", H5T_NATIVE_DOUBLE, {2, 2});
     },
     "/polynomial/cubic: expected R x r (R = 3 from /examples/hq, r = 2 from /examples/hq), found 2 x 2"},
    {"TooManyPairsOfPairs", [](Spoiler& s) { s.replace("/polynomial/quartic", H5T_NATIVE_DOUBLE, {9}); },
     "/polynomial/quartic: expected Q (Q = 6 from /examples/hq), found 9"},
    {"ContactOfOtherVertices", [](Spoiler& s) { s.replace("/contact/areas", H5T_NATIVE_DOUBLE, {3}); },
     "/contact/areas: expected k (k = 2 from /contact/vertices), found 3"},
    {"RenderTetBeyond", [](Spoiler& s) { s.set("/render/tets", 2, std::int32_t{2}); },
     "/render/tets: expected an index from 0 to 1 (n_t = 2 from /object/tets), found 2 at [2]"},
    {"RenderTriangleBeyond", [](Spoiler& s) { s.set("/render/triangles", 1, std::int32_t{3}); },
     "/render/triangles: expected an index from 0 to 2 (v = 3 from /render/vertices), found 3 at [0][1]"},
    {"BoneAfterItsChild", [](Spoiler& s) { s.set("/skeleton/parents", 1, std::int32_t{1}); },
     "/skeleton/parents: expected for bone 1 a bone before it, or -1, found 1"},
    {"FlatBone", [](Spoiler& s) { s.set("/skeleton/bind", 10, 0.0); },
     "/skeleton/bind: expected axes of bones that can be inverted, found others for bone 0"},
    {"BoneWeights", [](Spoiler& s) { s.set("/skeleton/weights", 5, 0.75); },
     "/skeleton/weights: expected numbers that add up to 1 in row 2, found 1.25"},
    {"DrawnBones", [](Spoiler& s) { s.set("/render/bones", 3, std::int32_t{2}); },
     "/render/bones: expected bones below 2, found 2"},
    {"DrawnBoneWeights", [](Spoiler& s) { s.set("/render/bone_weights", 3, 0.5); },
     "/render/bone_weights: expected numbers that add up to 1 in row 1, found 0.75"},
    {"FramesBeyond", [](Spoiler& s) { s.set("/skeleton/first_frames", 2, std::int32_t{9}); },
     "/skeleton/first_frames: expected numbers that ascend from 0 to 3, found others"},
    {"FrameTimes", [](Spoiler& s) { s.set("/skeleton/times", 1, 0.0); },
     "/skeleton/times: expected times that ascend in each animation, found others at 0"},
    {"BoneTurn", [](Spoiler& s) { s.set("/skeleton/poses", 3, 0.5); },
     "/skeleton/poses: expected a unit quaternion in row 0, found one of length 0.5"},
    {"RenderWeights", [](Spoiler& s) { s.set("/render/barycentric", 6, 0.5); },
     "/render/barycentric: expected numbers that add up to 1 in row 1, found 1.5"},
    {"ContactWithoutArea", [](Spoiler& s) { s.set("/contact/areas", 1, 0.0); },
     "/contact/areas: expected a number > 0, found 0 at [1]"},
    {"ExponentsOfOtherExamples",
     [](Spoiler& s) {
       s.replace("/targets/exponents", H5T_NATIVE_INT32, {6, 2});
     },
     "/targets/exponents: expected c x K (K = 3 from the groups of /examples), found 6 x 2"},
    {"TooFewControlPoints",
     [](Spoiler& s) {
       s.replace("/targets/control_points", H5T_NATIVE_DOUBLE, {1, 5, 2});
     },
     "/targets/control_points: expected P x c x r (c = 6 from /targets/exponents, r = 2 from /examples/hq), found 1 x "
     "5 x 2"},
    {"TooManyKnots", [](Spoiler& s) { s.replace("/targets/knots", H5T_NATIVE_DOUBLE, {3}); },
     "/targets/knots: expected P+1 (P+1 = 2 from /targets/control_points), found 3"},
    {"FirstKnot", [](Spoiler& s) { s.set("/targets/knots", 0, 0.25); },
     "/targets/knots: expected 0 at [0], found 0.25"},
    {"LastKnot", [](Spoiler& s) { s.set("/targets/knots", 1, 0.75); }, "/targets/knots: expected 1 at [1], found 0.75"},
    {"KnotsOutOfOrder", [](Spoiler& s) { s.set("/targets/knots", 0, 1.0); },
     "/targets/knots: expected each element above the one before it, found 1 at [1] after 1"},
    {"EmptyDataset", [](Spoiler& s) { s.replace("/modal/frequencies", H5T_NATIVE_DOUBLE, {0}); },
     "/modal/frequencies: expected some elements, found 0"},
    {"LargerThanTheFile", [](Spoiler& s) { s.replace("/modal/frequencies", H5T_NATIVE_DOUBLE, {hsize_t{1} << 60}); },
     "/modal/frequencies: expected sizes that fit in a file of "},
    {"SizesThatOverflow",
     [](Spoiler& s) {
       s.replace("/shape_space/eigenfunctions", H5T_NATIVE_DOUBLE, {0, hsize_t{1} << 62});
     },
     "/shape_space/eigenfunctions: expected sizes that fit in a file of "},
    {"LargeChunk", [](Spoiler& s) { s.replace_deflated("/modal/frequencies", {1000}, {hsize_t{1} << 28}, 1); },
     "/modal/frequencies: expected chunks that fit in a file of "},
    {"DeflatedTwice", [](Spoiler& s) { s.replace_deflated("/modal/frequencies", {999}, {999}, 2); },
     "/modal/frequencies: expected contiguous data or deflate, found HDF5 filter 1 twice"},
    {"NeverWritten", [](Spoiler& s) { s.replace("/modal/frequencies", H5T_NATIVE_DOUBLE, {1000}); },
     "/modal/frequencies: expected data, found none"},
    {"ExternalData",
     [](Spoiler& s) {
       const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
       H5Pset_external(properties, "/dev/zero", 0, H5F_UNLIMITED);
       s.replace("/modal/frequencies", H5T_NATIVE_DOUBLE, {1001}, properties);
       H5Pclose(properties);
     },
     "/modal/frequencies: expected data within the file, found a reference"},
    {"NotANumber", [](Spoiler& s) { s.set("/modal/basis", 7, std::nan("")); },
     "/modal/basis: expected finite numbers, found nan at [1][0][1]"},
    {"Infinite", [](Spoiler& s) { s.set("/object/vertices", 14, kInfinity, false); },
     "/object/vertices: expected finite numbers, found inf at [4][2]; the data are damaged"},
    {"NegativeWeight", [](Spoiler& s) { s.set("/cubature/weights", 1, -0.5); },
     "/cubature/weights: expected a number >= 0, found -0.5 at [1]"},
    {"ZeroVolume", [](Spoiler& s) { s.set("/cubature/volumes", 0, 0.0); },
     "/cubature/volumes: expected a number > 0, found 0 at [0]"},
    {"Incompressible", [](Spoiler& s) { s.set("/object/poisson_ratio", 1, 0.5); },
     "/object/poisson_ratio: expected a number above -1 and below 0.5, found 0.5 at [1]"},
    {"NotAFlag", [](Spoiler& s) { s.set("/object/fixed", 2, std::uint8_t{2}); },
     "/object/fixed: expected 0 or 1, found 2 at [2]"},
    {"IndexTooLarge", [](Spoiler& s) { s.set("/object/tets", 5, std::int32_t{5}); },
     "/object/tets: expected an index from 0 to 4 (n = 5 from /object/vertices), found 5 at [1][1]"},
    {"NegativeIndex", [](Spoiler& s) { s.set("/object/surface", 0, std::int32_t{-1}); },
     "/object/surface: expected an index from 0 to 4 (n = 5 from /object/vertices), found -1 at [0][0]"},
    {"NoSuchElement", [](Spoiler& s) { s.set("/cubature/elements", 1, std::int32_t{2}); },
     "/cubature/elements: expected numbers of the 2 elements of /object, from 0 on, found 2"},
    {"ElementTwice", [](Spoiler& s) { s.set("/cubature/elements", 0, std::int32_t{1}); },
     "/cubature/elements: expected each element above the one before it, found 1 at [1] after 1"},
    {"EigenvaluesNotAscending", [](Spoiler& s) { s.set("/shape_space/eigenvalues", 0, 99.0); },
     "/shape_space/eigenvalues: expected no element below the one before it, found 10.125 at [1] after 99"},
    {"GramNotSymmetric", [](Spoiler& s) { s.set("/examples/gram", 1, 0.0); },
     "/examples/gram: expected a symmetric matrix, found "},
    {"StiffnessNotSymmetric", [](Spoiler& s) { s.set("/polynomial/stiffness", 1, 0.0); },
     "/polynomial/stiffness: expected a symmetric matrix, found "},
    {"UnknownInternalForce", [](Spoiler& s) { s.set_text("/cubature", "internal_force", "auto"); },
     "/cubature@internal_force: expected \"cubature\" or \"polynomial\", found \"auto\""},
    {"UnknownEnergyReference", [](Spoiler& s) { s.set_text("/targets", "energy_reference", "none"); },
     "/targets@energy_reference: expected \"example\" or \"rest\", found \"none\""},
    {"DegreeZero", [](Spoiler& s) { s.set_integer("/targets", "degree", 0); },
     "/targets@degree: expected a number > 0, found 0"},
    {"NegativeExponent", [](Spoiler& s) { s.set("/targets/exponents", 4, std::int32_t{-1}); },
     "/targets/exponents: expected a number >= 0, found -1 at [1][1]"},
    {"ExponentsOfAnotherDegree", [](Spoiler& s) { s.set_integer("/targets", "degree", 3); },
     "/targets/exponents: expected 3 0 0 in row 0, for degree 3, found 2 0 0"},
    {"ExponentsOutOfOrder", [](Spoiler& s) { s.set("/targets/exponents", 14, std::int32_t{2}); },
     "/targets/exponents: expected 0 1 1 in row 4, for degree 2, found 0 1 2"},
    {"TermBeyondTheDegree",
     [](Spoiler& s) {
       set_exponents(s, {0, 0, 0, 1, 1, 0, 0, 2, 0, 1, 0, 1, 0, 0, 2, 0, 1, 2});
     },
     "/targets/exponents: expected one or two examples behind those of the row before, to at most 2, in row 5, found "
     "0 1 2"},
    {"TermWithoutItsLastRow",
     [](Spoiler& s) {
       set_exponents(s, {0, 0, 0, 1, 1, 0, 0, 2, 0, 1, 0, 1, 0, 1, 1, 0, 1, 1});
     },
     "/targets/exponents: expected 0 0 2 in row 4, found 0 1 1"},
    {"TermTwice",
     [](Spoiler& s) {
       set_exponents(s, {0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 1, 1, 0, 1, 1});
     },
     "/targets/exponents: expected one or two examples behind those of the row before, to at most 2, in row 4, found "
     "0 1 1"},
    {"TermOfNoExample",
     [](Spoiler& s) {
       set_exponents(s, {0, 0, 0, 2, 0, 0, 0, 2, 0, 1, 0, 1, 0, 0, 2, 0, 1, 1});
     },
     "/targets/exponents: expected one or two examples behind those of the row before, to at most 2, in row 1, found "
     "2 0 0"},
    {"IndexTwice", [](Spoiler& s) { s.set_integer("/examples/bend", "index", 2); },
     "/examples/twist \xc3\xa9@index: expected another index for each example, found 2, that of bend too"},
    {"IndexBeyondCount", [](Spoiler& s) { s.set_integer("/examples/bend", "index", 3); },
     "/examples/bend@index: expected an index from 0 to 2 (K = 3 from the groups of /examples), found 3"},
    {"TwoRestPoses", [](Spoiler& s) { s.set_integer("/examples/bend", "is_rest", 1); },
     "/examples/bend@is_rest: expected 1 for index 0 and 0 for all others, found 1 for index 1"},
    {"NoRestPose", [](Spoiler& s) { s.set_integer("/examples/z rest", "is_rest", 0); },
     "/examples/z rest@is_rest: expected 1 for index 0 and 0 for all others, found 0 for index 0"},
};
INSTANTIATE_TEST_SUITE_P(Each, BadBundleIs, ::testing::ValuesIn(kBadBundles),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(TargetKnots, AreBetweenTheEndsForTwoExamplesOnly) {
  EXPECT_FALSE(check_knots(Eigen::Vector2d(0, 1), 4));
  EXPECT_FALSE(check_knots(Eigen::Vector4d(0, 0.1, 0.2, 1), 2));
  const auto fault = check_knots(Eigen::Vector4d(0, 0.1, 0.2, 1), 3);
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->expected, "2 knots for 3 examples");
  EXPECT_EQ(fault->found, "4");
}

TEST(BadBundle, WithABasisThatMovesFixedVertices) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  Spoiler(folder / "a.h5").set("/modal/basis", 4, 0.5);
  try {
    read_bundle(folder / "a.h5");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/modal/basis: expected zeros on vertex 0, fixed by /object/fixed"));
  }
}

// 800 kB that take a hundredth of that in the file, 200 times.
TEST(BadBundle, WithManyNamesOfTheSameData) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  {
    Spoiler spoiler(folder / "a.h5");
    spoiler.replace_deflated("/regions/left/projection/target_basis", {2, 50000}, {2, 50000}, 1, 100000);
    for (int i = 0; i < 200; ++i) spoiler.link("/regions/left", "/regions/more " + std::to_string(i));
  }
  ASSERT_LT(std::filesystem::file_size(folder / "a.h5"), 120000);
  try {
    read_bundle(folder / "a.h5");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/projection/target_basis: expected "));
    EXPECT_THAT(error.what(), HasSubstr(" bytes in all datasets at most, for the size of the file, found "));
  }
}

TEST(BadBundle, OfAnotherKindOfFile) {
  const TemporaryFolder folder;
  for (const std::string content : {"not HDF5 at all, but long enough to have a superblock if it were", "x"}) {
    write_file(folder / "a.h5", content);
    try {
      read_bundle(folder / "a.h5");
      FAIL();
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("a.h5: expected an HDF5 file, found another kind of file"));
    }
  }
}

TEST(ValidateBundle, ReportsAllProblems) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  {
    Spoiler spoiler(folder / "a.h5");
    spoiler.set("/cubature/weights", 0, -1.0);
    spoiler.set("/object/density", 1, 0.0);
    spoiler.remove("/modal/gravity_load");
    spoiler.set_number("/examples/bend", "scale", 0);
    spoiler.set_text("/cubature/volumes", "units", "litres");
  }
  EXPECT_THAT(
      validate_bundle(folder / "a.h5"),
      ::testing::UnorderedElementsAre(HasSubstr("/cubature/weights: "), HasSubstr("/object/density: "),
                                      HasSubstr("/modal/gravity_load: "), HasSubstr("/examples/bend@scale: "),
                                      HasSubstr("/cubature/volumes@units: expected \"m^3\", found \"litres\"")));
}

TEST(ValidateBundle, ReportsWhatTheReaderIgnores) {
  const TemporaryFolder folder;
  write_bundle(small_model(true), folder / "a.h5");
  {
    Spoiler spoiler(folder / "a.h5");
    spoiler.add_group("/notes");
    spoiler.add_group("/modal/other");
    spoiler.add_group("/rigid");
  }
  EXPECT_NO_THROW(read_bundle(folder / "a.h5"));
  EXPECT_THAT(
      validate_bundle(folder / "a.h5"),
      ::testing::UnorderedElementsAre(HasSubstr("/notes: expected only what"), HasSubstr("/modal/other: expected only"),
                                      HasSubstr("/@features: expected \"rigid\", which the file holds")));
}

TEST(ValidateBundle, ReportsAFileThatIsNone) {
  const TemporaryFolder folder;
  EXPECT_THAT(validate_bundle(folder / "none.h5"), ::testing::ElementsAre(HasSubstr("no such file")));
}

}  // namespace
}  // namespace exmat
