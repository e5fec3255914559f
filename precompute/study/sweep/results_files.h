#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "precompute/study/sweep/study.h"

namespace exmat::precompute {

/// One header line, then a line for each point; RFC 4180. Names end in the unit where there is one; errors are
/// relative.
std::string results_csv(const StudyResult& result);

/// All of it.
nlohmann::ordered_json results_json(const StudyResult& result);

/// Members for ASSET.json and SCENE.json that make a point's bundle and run it.
nlohmann::ordered_json asset_fragment(const StudyResult& result, const PointResult& point);
nlohmann::ordered_json scene_fragment(const StudyResult& result, const PointResult& point);

/// report.html, results.csv, results.json; recommended_asset.json and recommended_scene.json, which go where nothing is
/// recommended; the three files sources.*, which go where errors are not split.
void write_results(const StudyResult& result, const std::filesystem::path& folder);

}  // namespace exmat::precompute
