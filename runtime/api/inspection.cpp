#include <algorithm>
#include <cinttypes>
#include <cstring>

#include "common/bundle/bundle.h"
#include "exmat/exmat.h"
#include "runtime/api/arguments.h"
#include "runtime/api/handles.h"
#include "runtime/api/reading.h"

using namespace exmat;           // NOLINT(google-build-using-namespace)
using namespace exmat::runtime;  // NOLINT(google-build-using-namespace)

namespace {

/// Which of the model's example forces; none where it has no such one.
const ExampleModel* example_force(const Model& model, std::int64_t region) {
  if (region != -1) return model.region(region);
  return model.has_whole_body_examples() ? &model.examples.front() : nullptr;
}

std::size_t force_place(const ExampleModel* force, const Model& model) {
  return static_cast<std::size_t>(force - model.examples.data());
}

const NamedPose* named_pose(const exmat_model& model, std::int64_t region, std::int64_t example) {
  const ExampleModel* force = example_force(model.model(), region);
  if (force == nullptr) return nullptr;
  const auto& poses = model.source->loaded.poses[force_place(force, model.model())];
  return example >= 0 && example < std::ssize(poses) ? &poses[static_cast<std::size_t>(example)] : nullptr;
}

bool has_group(const BundleSummary& summary, const char* group) {
  return std::ranges::find(summary.groups, group) != summary.groups.end();
}

exmat_bundle_info info_of(const BundleSummary& summary) {
  exmat_bundle_info info{};
  info.modes = summary.modes;
  info.vertices = summary.vertices;
  info.elements = summary.cubature_elements;
  info.examples = summary.examples;
  info.regions = std::ssize(summary.regions);
  info.render_vertices = summary.render_vertices;
  info.constrained = summary.constrained ? 1 : 0;
  info.contact = has_group(summary, "contact") ? 1 : 0;
  info.polynomial = summary.has_polynomial ? 1 : 0;
  info.targets = summary.has_targets ? 1 : 0;
  return info;
}

/// The pull of the target of these weights.
Eigen::VectorXd pull_of(const ExampleModel& force, const ExampleState& state) {
  Eigen::VectorXd pull;
  if (force.table) {
    TargetTable::Workspace workspace = force.table->make_workspace();
    pull.resize(force.table->modes());
    force.table->evaluate(state.weights, workspace, pull);
  } else {
    pull = force.target_pull * state.target;
  }
  return pull;
}

}  // namespace

exmat_status exmat_bundle_read_info(const char* bundle_path, exmat_bundle_info* info) noexcept {
  EXMAT_REQUIRE(bundle_path);
  EXMAT_REQUIRE(info);
  if (const exmat_status status = check_size(__func__, info->size, kBundleInfoSizes)) return status;
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    give(info_of(summarise_bundle(bundle_path)), info->size, info);
  });
}

exmat_status exmat_bundle_read_region_name(const char* bundle_path, std::int64_t region, char* name,
                                           std::int64_t bytes) noexcept {
  EXMAT_REQUIRE(bundle_path);
  EXMAT_REQUIRE(name);
  return guarded(__func__, [&] {
    const std::lock_guard lock(reading());
    const BundleSummary summary = summarise_bundle(bundle_path);
    if (region < 0 || region >= std::ssize(summary.regions))
      throw InvalidArgument("region = " + std::to_string(region) + ": the bundle has " +
                            std::to_string(summary.regions.size()));
    const std::string& found = summary.regions[static_cast<std::size_t>(region)].name;
    if (bytes <= std::ssize(found))
      throw InvalidArgument("bytes = " + std::to_string(bytes) + ": expected at least " +
                            std::to_string(found.size() + 1));
    std::memcpy(name, found.c_str(), found.size() + 1);
  });
}

std::int64_t exmat_model_elements(const exmat_model* model) noexcept {
  return model != nullptr ? model->source->loaded.element_weights.size() : -1;
}

exmat_status exmat_model_read_element_weights(const exmat_model* model, double* weights, std::int64_t count) noexcept {
  EXMAT_REQUIRE(model);
  EXMAT_REQUIRE(weights);
  const Eigen::VectorXd& found = model->source->loaded.element_weights;
  EXMAT_REQUIRE_LENGTH(count, found.size());
  std::copy_n(found.data(), count, weights);
  return EXMAT_OK;
}

const char* exmat_model_example_name(const exmat_model* model, std::int64_t region, std::int64_t example) noexcept {
  const NamedPose* pose = model != nullptr ? named_pose(*model, region, example) : nullptr;
  return pose != nullptr ? pose->name.c_str() : nullptr;
}

exmat_status exmat_model_read_example_pose(const exmat_model* model, std::int64_t region, std::int64_t example,
                                           double* q, std::int64_t modes) noexcept {
  EXMAT_REQUIRE(model);
  EXMAT_REQUIRE(q);
  EXMAT_REQUIRE_LENGTH(modes, model->model().modes());
  const NamedPose* pose = named_pose(*model, region, example);
  if (pose == nullptr)
    return fail(EXMAT_INVALID_ARGUMENT, "%s: region = %" PRId64 ", example = %" PRId64 ": there is none such", __func__,
                region, example);
  std::copy_n(pose->pose.data(), modes, q);
  return EXMAT_OK;
}

exmat_status exmat_body_read_target(const exmat_body* body, std::int64_t region, double* q,
                                    std::int64_t modes) noexcept {
  EXMAT_REQUIRE(body);
  EXMAT_REQUIRE(q);
  EXMAT_REQUIRE_LENGTH(modes, body->modes());
  return guarded(__func__, [&] {
    const std::size_t place = body->example_force(region);
    const ExampleModel& force = body->model().examples[place];
    const ExampleState& state = body->state.examples[place];
    const ExampleSettings& settings = body->scene.examples[place];
    const bool is_found = force.table ? body->state.step > 0 && !settings.elastic : state.has_target;
    const Eigen::VectorXd pull = is_found && acts(settings) ? pull_of(force, state) : Eigen::VectorXd::Zero(modes);
    std::copy_n(pull.data(), modes, q);
  });
}
