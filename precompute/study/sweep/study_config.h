#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "precompute/study/measure/timing.h"

namespace exmat::precompute {

/// Lists of settings; an empty one stands for the asset's or the scene's own.
struct SweepConfig {
  std::vector<int> eigenfunctions{};          ///< m
  std::vector<int> basis_size{};              ///< r
  std::vector<int> linear_modes{};            ///< whose derivatives are added
  std::vector<std::string> training{};        ///< names of Training
  std::vector<int> cubature_elements{};       ///< s
  std::vector<std::string> material{};        ///< names of MaterialModel
  std::vector<double> time_step{};            ///< [s]
  std::vector<std::string> integrator{};      ///< "bdf2", "backward_euler", "newmark"
  std::vector<std::string> internal_force{};  ///< "cubature", "polynomial", "all_elements"
  std::vector<std::string> target{};          ///< "table", "solve"
  std::vector<std::string> precision{};       ///< "double", "mixed"
  std::vector<std::string> space{};           ///< "reduced", "full"
  std::vector<double> elastic_stiffness{};    ///< e, of elastic example forces
};

/// Integration of the full space; absent: as the point.
struct ReferenceConfig {
  std::optional<double> time_step;  ///< [s]
  std::optional<std::string> integrator;
};

/// Settings of the split of one point's error by its sources.
struct SourcesConfig {
  std::optional<int> eigenfunctions;  ///< m of the full problem; absent: twice the point's, or the largest of the study
  int time_steps = 2;                 ///< steps of the full problem for one of the point's; 1: that source is left out
  std::optional<std::filesystem::path> exact_examples;  ///< asset file whose poses correspond exactly to the object
};

/// The asset of one of several bodies.
struct BodyAsset {
  std::string body;  ///< its name in the scene
  std::filesystem::path asset;
};

/// STUDY.json after validation, paths resolved against its folder.
struct StudyConfig {
  std::filesystem::path file;
  std::filesystem::path asset;    ///< empty: there are `assets`
  std::vector<BodyAsset> assets;  ///< assets of a scene of several bodies
  std::filesystem::path scene;
  std::string name;
  std::optional<std::int64_t> steps;
  int frames = 200;
  std::vector<SweepConfig> sweeps;
  ReferenceConfig reference;
  std::optional<SourcesConfig> sources;
  TimingConfig timing;
};

/// Reads STUDY.json and validates it against schemas/study.json. Throws InputError.
StudyConfig load_study(const std::filesystem::path& file);

}  // namespace exmat::precompute
