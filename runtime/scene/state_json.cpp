#include "runtime/scene/state_json.h"

#include <array>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "common/core/error.h"
#include "runtime/sim/frame/frame_numbers.h"

namespace exmat::runtime {
namespace {

using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

// The members of a State that are arrays [r] of a file's body.
struct ModeArray {
  const char* name;
  Eigen::VectorXd State::*member;
};
constexpr ModeArray kModeArrays[] = {{"reduced", &State::q},
                                     {"reduced_velocity", &State::v},
                                     {"reduced_before", &State::q_previous},
                                     {"reduced_velocity_before", &State::v_previous},
                                     {"acceleration", &State::a},
                                     {"applied_force", &State::applied_force}};

// Those of a FullMotion, [f].
struct VertexMember {
  const char* name;
  Eigen::VectorXd FullMotion::*member;
};
constexpr VertexMember kVertexArrays[] = {{"displacement", &FullMotion::q},
                                          {"velocity", &FullMotion::v},
                                          {"displacement_before", &FullMotion::q_previous},
                                          {"velocity_before", &FullMotion::v_previous}};

// Those of an Attachment that are vectors.
struct AttachmentVector {
  const char* name;
  Eigen::Vector3d Attachment::*member;
};
constexpr std::size_t kNumbersBefore = 13;  // of a FreeStart
constexpr AttachmentVector kAttachmentVectors[] = {{"force", &Attachment::force},
                                                   {"torque", &Attachment::torque},
                                                   {"mean", &Attachment::mean},
                                                   {"mean_before", &Attachment::mean_before}};

/// Start of the step before, which the next step of a held free body in its modes takes; null of other bodies. The
/// state may be const.
auto* frame_before(auto& state) {
  auto* const free = std::get_if<FreeState>(&state.frame);
  return free != nullptr && holds_modes(state.attachments) ? &free->before : nullptr;
}

void visit_numbers(auto& before, auto&& visitor) {
  visitor(before.position, before.orientation.coeffs(), before.linear_momentum, before.angular_momentum);
}

// One body of a file.
class BodyReader {
 public:
  BodyReader(const std::filesystem::path& file, std::string place, const Json& body, const LoadedScene& loaded)
      : file_(file), place_(std::move(place)), body_(body), loaded_(loaded) {}

  /// `state` is one of the same model and scene.
  void read(State& state) const {
    for (const auto& [name, member] : kModeArrays) read_array(name, body_[name], state.*member);
    state.step = body_["step"];
    state.time = static_cast<double>(state.step) * loaded_.scene.time_step;
    state.elastic_energy = body_["elastic_energy"];
    state.begins_anew = body_["begins_anew"];
    state.contacts.first_step = body_.value("anew", false);
    state.contacts.account = body_.value("account", ContactState::kUnbounded);
    if (body_.contains("sleep"))
      state.sleep = {body_["sleep"]["asleep"], body_["sleep"]["still_steps"], body_["sleep"]["loads"]};
    const BodyFrame& frame = *loaded_.model->frame;
    const std::vector<double> numbers = body_["frame"];
    require_count("/frame", numbers.size(), frame.numbers(state.frame).size());
    frame.set_numbers(numbers, state.frame);
    require_count("/examples", body_["examples"].size(), state.examples.size());
    for (std::size_t i = 0; i < state.examples.size(); ++i) read_examples(i, state.examples[i]);
    read_contacts(state.contacts);
    read_full_space(state);
    read_attachments(state);
  }

 private:
  [[noreturn]] void refuse(const std::string& place, std::string expected, std::string found) const {
    throw InputError({file_.string(), place_ + place, std::move(expected), std::move(found),
                      "take the scene that the state was written with"});
  }
  void require_count(const std::string& place, std::size_t found, std::size_t expected) const {
    if (found != expected) refuse(place, fmt::format("{} entries", expected), fmt::format("{}", found));
  }
  void read_array(const std::string& name, const Json& numbers, Eigen::VectorXd& array) const {
    require_count("/" + name, numbers.size(), static_cast<std::size_t>(array.size()));
    for (Eigen::Index i = 0; i < array.size(); ++i) array[i] = numbers[static_cast<std::size_t>(i)];
  }
  void read_examples(std::size_t index, ExampleState& examples) const {
    const Json& from = body_["examples"][index];
    const std::string name = fmt::format("examples/{}/", index);
    read_array(name + "weights", from["weights"], examples.weights);
    read_array(name + "target", from["target"], examples.target);
    examples.has_target = from["has_target"];
    examples.target_converged = from["target_converged"];
  }
  void read_attachments(State& state) const {
    std::vector<Attachment>& attachments = state.attachments;
    const Json from = body_.value("attachments", Json::array());
    require_count("/attachments", from.size(), attachments.size());
    for (std::size_t i = 0; i < attachments.size(); ++i) {
      attachments[i].broken = from[i]["broken"];
      for (const auto& [name, member] : kAttachmentVectors) attachments[i].*member = vector_of(from[i][name]);
    }
    FreeStart* const before = frame_before(state);
    if (before == nullptr) return;
    const auto numbers = body_.value("frame_before", std::vector<double>());
    require_count("/frame_before", numbers.size(), kNumbersBefore);
    visit_numbers(*before, NumberReader{numbers});
  }
  void read_full_space(State& state) const {
    if (loaded_.model->skeleton && !(body_.contains("full_space") && body_["full_space"].contains("skeleton")))
      refuse("/full_space/skeleton", "the bones of the body", "none");
    state.full.reset();
    if (!body_.contains("full_space")) return;
    if (!loaded_.full) refuse("/full_space", "no such member of a body of space \"reduced\"", "one");
    const Json& from = body_["full_space"];
    read_array("full_space/force", from["force"], state.vertex_force);
    if (!from.contains("displacement")) return;
    const bool begins_anew = state.begins_anew;
    enter_full_space(*loaded_.full, *loaded_.model, state);
    for (const auto& [name, member] : kVertexArrays)
      read_array(std::string("full_space/") + name, from[name], (*state.full).*member);
    if (state.full->skeleton) {
      Eigen::VectorXd bones = numbers_of(*state.full->skeleton);
      read_array("full_space/skeleton", from["skeleton"], bones);
      set_numbers({bones.data(), static_cast<std::size_t>(bones.size())}, *state.full->skeleton);
    }
    state.full->alone = from["alone"];
    state.full->elastic_energy = state.elastic_energy;
    state.begins_anew = begins_anew;
  }
  void read_contacts(ContactState& contacts) const {
    const Json& from = body_["contacts"];
    const std::size_t obstacles = loaded_.scene.obstacles.size();
    if (from.size() > contacts.held.size())
      refuse("/contacts", fmt::format("at most {} contacts", contacts.held.size()), fmt::format("{}", from.size()));
    contacts.count = 0;
    for (const Json& entry : from) {
      HeldContact held{entry["vertex"], entry["obstacle"], entry["normal_force"], vector_of(entry["anchor"])};
      if (entry.contains("way_out")) held.way_out = vector_of(entry["way_out"]);
      held.overlap = entry.value("overlap", 0.0);
      const std::string place = fmt::format("/contacts/{}", contacts.count);
      const Eigen::Index vertices = loaded_.model->contact->vertices();
      if (held.vertex >= vertices) refuse(place, fmt::format("a vertex below {}", vertices), entry["vertex"].dump());
      if (static_cast<std::size_t>(held.obstacle) >= obstacles)
        refuse(place, fmt::format("an obstacle below {}", obstacles), entry["obstacle"].dump());
      contacts.held[contacts.count++] = held;
    }
  }

  const std::filesystem::path& file_;
  std::string place_;
  const Json& body_;
  const LoadedScene& loaded_;
};

}  // namespace

Eigen::Vector3d vector_of(const Json& numbers) { return Eigen::Vector3d(numbers[0], numbers[1], numbers[2]); }

OrderedJson state_to_json(const State& state, const BodyFrame& frame) {
  OrderedJson body{{"step", state.step},
                   {"elastic_energy", state.elastic_energy},
                   {"begins_anew", state.begins_anew},
                   {"anew", state.contacts.first_step},
                   {"frame", frame.numbers(state.frame)},
                   {"examples", OrderedJson::array()},
                   {"contacts", OrderedJson::array()}};
  if (state.contacts.account < ContactState::kUnbounded) body["account"] = state.contacts.account;
  for (const auto& [name, member] : kModeArrays) body[name] = array_of(state.*member);
  if (state.sleep.loads != 0)
    body["sleep"] = {
        {"asleep", state.sleep.asleep}, {"still_steps", state.sleep.still_steps}, {"loads", state.sleep.loads}};
  for (const ExampleState& examples : state.examples)
    body["examples"].push_back({{"weights", array_of(examples.weights)},
                                {"target", array_of(examples.target)},
                                {"has_target", examples.has_target},
                                {"target_converged", examples.target_converged}});
  if (state.vertex_force.size() > 0) {
    OrderedJson& full = body["full_space"] = {{"force", array_of(state.vertex_force)}};
    if (state.full) {
      full["alone"] = state.full->alone;
      for (const auto& [name, member] : kVertexArrays) full[name] = array_of((*state.full).*member);
      if (state.full->skeleton) full["skeleton"] = array_of(numbers_of(*state.full->skeleton));
    }
  }
  if (const FreeStart* const before = frame_before(state)) {
    std::array<double, kNumbersBefore> numbers{};
    NumberWriter writer{numbers.data()};
    visit_numbers(*before, writer);
    body["frame_before"] = numbers;
  }
  for (const Attachment& attachment : state.attachments) {
    OrderedJson& own = body["attachments"].emplace_back(OrderedJson{{"broken", attachment.broken}});
    for (const auto& [name, member] : kAttachmentVectors) own[name] = array_of(attachment.*member);
  }
  for (const HeldContact& held : std::span(state.contacts.held).first(state.contacts.count)) {
    body["contacts"].push_back({{"vertex", held.vertex},
                                {"obstacle", held.obstacle},
                                {"normal_force", held.normal_force},
                                {"anchor", array_of(held.anchor)}});
    if (!held.way_out.isZero(0)) body["contacts"].back()["way_out"] = array_of(held.way_out);
    if (held.overlap > 0) body["contacts"].back()["overlap"] = held.overlap;
  }
  return body;
}

void read_body_state(const std::filesystem::path& file, const std::string& place, const Json& body,
                     const LoadedScene& loaded, State& state) {
  BodyReader(file, place, body, loaded).read(state);
}

}  // namespace exmat::runtime
