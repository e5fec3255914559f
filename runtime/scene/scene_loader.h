#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/config/scene_config.h"
#include "runtime/sim/space/full/full_body.h"
#include "runtime/sim/step/reach.h"
#include "runtime/sim/step/scene.h"
#include "runtime/sim/step/scene_keys.h"
#include "runtime/sim/step/state.h"

namespace exmat::runtime {

/// An example, as it can be shown.
struct NamedPose {
  std::string name;
  Eigen::VectorXd pose;  ///< r
};

/// Places that the bodies of a scene reach for. runtime/scene/reach_loader.h.
struct LoadedReach {
  ReachTargets targets;              ///< places of the start
  std::vector<KeyedSetting> places;  ///< of each point [m]
};

struct Patch;

/// The patch of a scene's body that holds others.
struct LoadedOtherEnd {
  std::size_t kind = 0, number = 0;  ///< of the scene's bodies, and among those of its kind
  std::shared_ptr<const Patch> patch{};
};

/// A hold of a scene on bodies of one kind. runtime/scene/attachment_loader.h.
struct LoadedAttachment {
  std::string file, place;                ///< in the scene
  std::optional<std::size_t> only{};      ///< the one of these bodies; absent: all of them
  std::shared_ptr<const Patch> patch{};   ///< vertices that it holds
  std::optional<LoadedOtherEnd> other{};  ///< present where a body holds them
  Attachment attachment{};                ///< all but these, and id and frame
};

/// A scene ready to step, and how it came to be.
struct LoadedScene {
  std::unique_ptr<const Model> model;
  std::unique_ptr<const FullModel> full;  ///< present where the scene, or a host, may have steps in full space
  StepScene scene;                        ///< settings with keys as strong as they ever are
  SceneKeys keys;  ///< settings that change in time: to be applied to a copy of the scene before each step
  State start;     ///< start of every body, before anything holds it
  std::vector<VertexForceConfig> forces;  ///< forces of the scene's file, their vertices known
  std::vector<LoadedAttachment> attachments;
  std::optional<LoadedReach> reach;
  BundleSummary summary;
  std::vector<LedgerEntry> ledger;            ///< groups in and out, bytes as read
  std::vector<ReadRecord> records;            ///< datasets that were read, in order
  std::vector<std::vector<NamedPose>> poses;  ///< one list for each example force of the model
  Eigen::VectorXd element_weights;            ///< s, of the cubature
  ReducedModel data;  ///< /object and /modal, complete only if the scene writes positions, and /render
};

/// The bundle of a scene: a file, or a pack in memory.
BundleInput bundle_of(const SceneConfig& config);

/// Reads of the bundle what the scene needs, no more: positions only if it writes a trajectory. Throws InputError: a
/// group that the scene needs and the bundle lacks, a vertex out of range, an example that inverts an
/// element.
/// `obstacles`: those of the scene, where bodies share them; else they are made anew.
LoadedScene load_run(const SceneConfig& config, const Obstacles* obstacles = nullptr);

/// The plan of the step: one line for each stage, with its sizes, or why it is left out. docs/overview.md.
std::vector<std::string> describe_plan(const LoadedScene& loaded, const SceneConfig& config);

}  // namespace exmat::runtime
