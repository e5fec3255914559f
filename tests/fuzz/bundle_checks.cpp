#include "tests/fuzz/bundle_checks.h"

#include <array>

#include "common/bundle/bundle.h"
#include "common/core/error.h"

// HDF5 1.10 leaks where it meets damaged metadata.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5\n"; }

namespace exmat::fuzz {
namespace {

template <typename Read>
bool is_taken(Read read) {
  try {
    read();
    return true;
  } catch (const InputError&) {
    return false;
  }
}

void require(bool condition) {
  if (!condition) __builtin_trap();
}

}  // namespace

void check_bundle(const BundleInput& file) {
  constexpr std::array<std::int64_t, 2> kVertices = {0, 4};
  const bool is_read = is_taken([&] { read_bundle(file); });
  if (validate_bundle(file).empty()) require(is_read);
  BundleSummary summary;
  const bool is_summarised = is_taken([&] { summary = summarise_bundle(file); });
  if (is_read) require(is_summarised);
  if (!is_summarised) return;
  const Needs needs = fit_needs({.regions = {{{"left"}}}}, summary);
  is_taken([&] {
    read_bundle(file, {.groups = plan_groups(needs, summary.constrained, summary.examples, std::ssize(summary.regions),
                                             summary.render_vertices > 0),
                       .regions = needs.regions,
                       .step_only = true,
                       .positions = true});
  });
  is_taken([&] { read_basis_rows(file, kVertices); });
}

}  // namespace exmat::fuzz
