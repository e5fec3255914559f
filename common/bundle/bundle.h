#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/bundle/bundle_input.h"
#include "common/model/needs.h"
#include "common/model/reduced_model.h"

namespace exmat {

/// Writes the groups that the model holds to a temporary file beside `path`, then renames it over `path`. The same
/// model gives the same bytes. Throws WorkError (message names the file); `path` is then as it was.
void write_bundle(const ReducedModel& model, const std::filesystem::path& path);

/// Writes the groups that the model holds as a pack, likewise: all arrays but those that no run reads. Throws
/// WorkError.
void write_pack(const ReducedModel& model, const std::filesystem::path& path);

/// Sets the bytes of each included group's datasets as write_bundle would write them.
void fill_bytes(const ReducedModel& model, std::vector<LedgerEntry>& ledger);

/// One region, as a bundle lists it.
struct RegionSummary {
  std::string name;
  std::int64_t examples = 0;                                     ///< K
  bool has_targets = false;                                      ///< /regions/NAME/targets is there
  bool has_target_space = false;                                 ///< /regions/NAME/target_space is there
  EnergyReference energy_reference = EnergyReference::kExample;  ///< reference of its targets, if any
};

/// Summary of a bundle, read from its attributes and table of contents alone.
struct BundleSummary {
  std::string asset_name, generator, input_sha256;
  bool is_pack = false;
  std::vector<std::string> groups;  ///< present, in bundle order
  bool constrained = false;         ///< root attribute of that name (int64, 0 or 1)
  std::int64_t vertices = 0, tets = 0, modes = 0, cubature_elements = 0, eigenfunctions = 0, examples = 0;
  ForceMethod internal_force = ForceMethod::kCubature;           ///< choice for `auto`, never `auto` itself
  EnergyReference energy_reference = EnergyReference::kExample;  ///< reference of /targets, if any
  bool has_polynomial = false;                                   ///< /polynomial is there
  bool has_targets = false;                                      ///< /targets is there
  bool has_target_space = false;                                 ///< /target_space is there
  bool knows_scene = false;                                      ///< its basis has learned from the loads of a scene
  std::vector<RegionSummary> regions;
  std::int64_t render_vertices = 0;  ///< vertices of /render; 0 without it
  std::int64_t bones = 0;            ///< bones of /skeleton; 0 without it
};
BundleSummary summarise_bundle(const BundleInput& input);

/// The part of these needs that the bundle serves: internal_force `auto` becomes its choice, targets are not needed
/// where it has none of that energy_reference, and the space of targets where it has none or the targets serve. Of the
/// regions likewise; all of them where the needs name none.
Needs fit_needs(Needs needs, const BundleSummary& summary);

/// Record of a dataset that was read: path and bytes.
struct ReadRecord {
  std::string dataset;
  std::size_t bytes = 0;
};

/// Which parts of a bundle to read.
struct BundleRequest {
  /// From plan_groups(). An included group that the file lacks is an InputError that names it.
  std::vector<LedgerEntry> groups;
  /// Which regions, with their targets or not. One that the file lacks is an InputError. Absent: all that there is.
  std::optional<std::vector<RegionNeeds>> regions{};
  bool step_only = false;   ///< only datasets whose schema `use` is "step": what stepping needs
  bool positions = false;   ///< with step_only: also those with `use` "positions": what writing positions needs
  bool full_space = false;  ///< with step_only: also those with `use` "positions" or "full_space"
  bool look = false;        ///< with step_only: also those with `use` "look"
  bool places = false;      ///< with step_only: also those with `use` "places"
};

/// Reads and validates: magic, version, types, sizes, ranges, finiteness, checksums, cross-references. Throws
/// InputError that names the file and the dataset. `record`, if given, receives every dataset that was read.
ReducedModel read_bundle(const BundleInput& input, const BundleRequest& request,
                         std::vector<ReadRecord>* record = nullptr);

/// Reads all of it.
ReducedModel read_bundle(const BundleInput& input);

/// [3k x r] rows of /modal/basis for k vertices; ids out of range are an InputError.
RowMatrix read_basis_rows(const BundleInput& input, std::span<const std::int64_t> vertices,
                          std::vector<ReadRecord>* record = nullptr);

/// All that is wrong with a bundle, one message each; empty if it is sound. Beyond what read_bundle checks: the
/// attributes of every dataset, the list of features, and entries that the format does not have (which read_bundle
/// ignores).
std::vector<std::string> validate_bundle(const BundleInput& input);

}  // namespace exmat
