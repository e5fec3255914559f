#pragma once

#include <string>

namespace exmat {

struct BundleOptions {
  std::string asset, bundle;     ///< asset: ASSET.json, or a surface that stands for one
  std::string write_asset;       ///< file for what a surface stands for; empty: none
  std::string scene;             ///< empty: what the asset needs
  std::string alignment_report;  ///< folder; empty: none
  std::string depfile, report;   ///< files; empty: none
  std::string cache;             ///< folder of stages; empty: none
  double training_budget = 0;    ///< [s]; 0: no limit
  bool if_changed = false;       ///< nothing is done where the bundle is of these inputs
};

/// Computes and writes a bundle, prints what came out, then writes the depfile and, also of a failure, the report.
void bundle_command(const BundleOptions& options);

}  // namespace exmat
