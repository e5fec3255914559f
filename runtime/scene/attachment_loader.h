#pragma once

#include <optional>
#include <string>
#include <vector>

#include "runtime/scene/scene_loader.h"

namespace exmat::runtime {

/// Vertices of a body that something is to hold.
struct Patch {
  std::vector<std::int32_t> vertices;  ///< k
  VertexArray rest;                    ///< k x 3; this and the next two of a body that steps in its modes alone
  RowMatrix basis_rows;                ///< 3k x r
  Eigen::VectorXd masses;              ///< k
};

/// Reason why a body cannot be held as asked.
struct HoldFault {
  const char* member;  ///< that is to blame: "vertices", "kind", "to" or "to/vertices"
  std::string expected, found;
};

/// True if bodies of this model and scene step in their modes alone.
bool steps_in_modes(const FullModel* full, const StepScene& scene) noexcept;

/// The patch of these vertices of an object, with `basis_rows` [3k x r] where the body steps in its modes.
Patch make_patch(const ObjectData& object, std::vector<std::int32_t> vertices, RowMatrix basis_rows);

/// The same of the vertices that a selection at `place` of the scene has. Reads the rows from the bundle. Throws
/// InputError as select_vertices().
Patch load_patch(const SceneConfig& config, const ObjectData& object, const VertexSelection& selection,
                 const std::string& place, bool in_modes, LoadedScene& loaded);

/// Adds an attachment that has id, kind and frame to a body whose vertices it holds from where they are. Enters full
/// space where bodies are held there. What is to blame, and the state is as it was, but perhaps in full space, where it
/// cannot be held.
std::optional<HoldFault> hold(const Model& model, const FullModel* full, const StepScene& scene, const Patch& patch,
                              Attachment attachment, State& state);

/// A body at one end of an attachment between two, where it is.
struct End {
  const Model& model;
  const FullModel* full;
  const StepScene& scene;
  bool may_touch;  ///< others
  const Patch& patch;
  const State& state;
};

/// Adds an attachment that has id and kind to `state`, the own end's: the other end's patch, of body number `body` of
/// the same world, holds its own from where both are. What is to blame, and the state is as it was.
std::optional<HoldFault> hold_together(const End& own, const End& other, int body, Attachment attachment, State& state);

/// The attachments of a scene for bodies of one kind, of this object; `obstacles` are all of the scene. Throws
/// InputError: no such vertex, nothing selected.
std::vector<LoadedAttachment> load_attachments(const SceneConfig& config, const ObjectData& object,
                                               const Obstacles& obstacles, LoadedScene& loaded);

/// Those that hold one of these bodies, in the order of its state's: those to other bodies come last.
std::vector<const LoadedAttachment*> attachments_of(const LoadedScene& kind, std::size_t number);

/// Those to the world and to obstacles take hold of it where its state is. Throws InputError where they cannot.
void hold_body(const LoadedScene& kind, std::size_t number, State& state);

}  // namespace exmat::runtime
