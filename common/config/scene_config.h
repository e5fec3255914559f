#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/config/vertex_selection.h"
#include "common/model/choices.h"
#include "common/model/meeting_group.h"

namespace exmat {

/// A constant world-space force on each of the named vertices while start <= t < end.
struct VertexForceConfig {
  std::vector<std::int64_t> vertices;                    ///< 0-based ids
  Eigen::Vector3d force = Eigen::Vector3d::Zero();       ///< on each vertex [N]
  double start = 0;                                      ///< [s]
  double end = std::numeric_limits<double>::infinity();  ///< [s]
  std::optional<VertexSelection> places{};               ///< that give the vertices, which are not known yet
};

/// Keys of a setting that changes in time; none of one that does not. Before the first and after the last it has their
/// values.
struct KeysConfig {
  std::vector<double> times;            ///< ascending [s]
  std::vector<Eigen::VectorXd> values;  ///< one for each key, of the setting's size
  Interpolation interpolation = Interpolation::kLinear;

  bool empty() const { return times.empty(); }
};

/// Keys of an example force.
struct ExampleKeysConfig {
  KeysConfig stiffness, damping, bias, weights;

  bool empty() const { return stiffness.empty() && damping.empty() && bias.empty() && weights.empty(); }
};

/// An example whose weight follows the rotation of a joint against its parent, beyond the bind pose, in the joint's
/// axes: its angle about an axis, or its distance from another rotation.
struct DriverConfig {
  std::string example, joint;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< unit
  std::array<double, 2> angles{};                   ///< of weights 0 and 1 [rad]
  std::optional<Eigen::Quaterniond> rotation{};     ///< of weight 1, in place of the two
  double radius = 0;                                ///< beyond which it is 0 [rad]
};

/// Settings that have keys stand here with the value of the key that is strongest: the largest, of a bias the smallest,
/// of weights the first.
struct ExampleForceConfig {
  ExampleForceLaw law = ExampleForceLaw::kLinear;
  double stiffness = 0;  ///< kappa >= 0 [1/s^2]; of an elastic force its factor e >= 0
  double damping = 0;    ///< c_kappa >= 0 [1/s]
  double bias = 1;       ///< in [0, 1]
  TargetSource target = TargetSource::kAuto;
  int target_iterations = 4;  ///< most Newton iterations of `solve` in one step; the next step carries on
  EnergyReference energy_reference = EnergyReference::kExample;
  bool compensate = false;  ///< the bundle's targets make up for elasticity and gravity, of the whole body's examples
  std::optional<Eigen::VectorXd> weights{};  ///< [K] in place of those of the shape
  std::vector<DriverConfig> drivers{};       ///< likewise
  ExampleKeysConfig keys{};
};

/// The example force of one region of the bundle.
struct RegionForceConfig {
  std::string name;
  ExampleForceConfig force;
};

struct NewtonConfig {
  int max_iterations = 200;
  double tolerance = 1e-6;  ///< relative to |f_ext| + |f_int| + |inertia|
};

/// The unknowns of steps.
struct SpaceConfig {
  Space space = Space::kReduced;
  double release = 0.5;           ///< [s]
  NewtonConfig newton{20, 0.01};  ///< limits of steps in all vertices
};

struct SleepConfig {
  double energy = 0;  ///< a body below this kinetic energy [J]; 0: none
  double time = 0.5;  ///< for so long is left alone [s]
};

/// A pose of a rigid motion at a time.
struct KeyframeConfig {
  double time = 0;                                                  ///< [s]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< unit
};

// Shapes in the frame of their obstacle, which is the world without a motion [m].

struct PlaneConfig {
  Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();  ///< normal: unit, outward
};
struct SphereConfig {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0;
};
struct BoxConfig {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero(), half_extents = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< unit
};
struct CapsuleConfig {
  Eigen::Vector3d start = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::Zero();
  double radius = 0;
};
struct MeshConfig {
  std::filesystem::path file;
  double scale = 1, thickness = 0;  ///< thickness 0: closed
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< unit
};
struct HeightFieldConfig {
  std::optional<std::filesystem::path> file;  ///< grid of heights, else `heights`
  Eigen::MatrixXd heights;
  Eigen::Vector2d spacing = Eigen::Vector2d::Ones();  ///< along x and y
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< unit
};

/// Obstacle that bodies may touch; all per area of their surface.
struct ObstacleConfig {
  std::variant<PlaneConfig, SphereConfig, BoxConfig, CapsuleConfig, MeshConfig, HeightFieldConfig> shape;
  double stiffness = 1e6;              ///< pressure per depth [N/m^3]
  double damping = 0;                  ///< pressure per approach velocity [N s/m^3]
  double friction = 0;                 ///< Coulomb's coefficient
  std::vector<KeyframeConfig> motion;  ///< moves the shape's frame; empty: the world
  MeetingGroup meeting{};
};

/// An example's pose, scaled.
struct PoseConfig {
  std::string example;
  double weight = 1;
};

struct AnimationConfig {
  std::string name;
  double speed = 1;
  bool loop = true;
  double start = 0;  ///< [s]
};

/// Motion of a joint in its own axes, beyond its animation or the bind pose.
struct JointMotionConfig {
  std::string joint;
  std::vector<KeyframeConfig> motion;
};

/// Start of a body, and what carries it. Position to velocities are a free body's, motion a constrained one's.
struct BodyConfig {
  std::optional<Eigen::Vector3d> position;        ///< displacement of the centre of mass from rest [m]
  std::optional<Eigen::Quaterniond> orientation;  ///< about the centre of mass, unit
  std::optional<Eigen::Vector3d> linear_velocity, angular_velocity;  ///< world [m/s], [rad/s]
  std::optional<Eigen::VectorXd> reduced;                            ///< q; this or pose, or neither
  std::optional<PoseConfig> pose;
  std::vector<KeyframeConfig> motion;  ///< moves the fixed vertices: x = position + orientation X, X the rest mesh
  std::optional<AnimationConfig> animation;  ///< moves the bones of a body on a skeleton
  std::vector<JointMotionConfig> bones;      ///< on top of it
};

/// A patch of a body that holds those of others.
struct HoldingBodyConfig {
  std::size_t kind = 0, number = 0;  ///< of the scene's bodies, and among those of its kind
  VertexSelection vertices{};        ///< of its object
};

/// A patch of bodies of one kind that the world, an obstacle or another body holds.
struct AttachmentConfig {
  std::string place;                      ///< JSON pointer in the scene's file
  std::optional<std::size_t> only{};      ///< the one of these bodies; absent: all of them
  VertexSelection vertices{};             ///< of the object
  std::optional<std::size_t> obstacle{};  ///< of the scene's; absent: the world, or
  std::optional<HoldingBodyConfig> body{};
  std::vector<KeyframeConfig> motion{};  ///< of the frame, of the world
  AttachmentKind kind = AttachmentKind::kFixed;
  double stiffness = 1e4, damping = 0;                           ///< both for a spring [N/m], [N s/m]
  double break_force = std::numeric_limits<double>::infinity();  ///< [N]
};

/// A point of a body, the mean of vertices by mass, and its place in the world [m].
struct ReachTargetConfig {
  VertexSelection vertices{};
  KeysConfig position{};  ///< one key where it stays
};

/// Places that the weights of examples are to bring points of a body to.
struct ReachConfig {
  std::string region;  ///< whose examples; empty: those of the whole body
  std::vector<ReachTargetConfig> targets;
  std::optional<Eigen::VectorXd> lowest{}, highest{};  ///< [K] limits of the weights; absent: 0 and 1
  double change = 0.05;                                ///< most that a weight changes in a step, in (0, 1]
  double horizon = 0.5;                                ///< > 0 [s]
};

/// SCENE.json after validation, paths resolved against its folder. schemas/scene.json.
struct SceneConfig {
  std::filesystem::path file;
  std::filesystem::path bundle;
  std::shared_ptr<const std::string> pack;  ///< in memory, in place of the file `bundle`; no file sets it
  double time_step = 0.001;                 ///< [s]
  std::int64_t steps = 1000;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [m/s^2]; with keys the largest
  KeysConfig gravity_keys;
  Integrator integrator = Integrator::kBdf2;
  ForceMethod internal_force = ForceMethod::kAuto;  ///< auto: the bundle's choice
  double mass_damping = 0;                          ///< alpha [1/s]
  double stiffness_damping = 0;                     ///< beta [s]
  Precision precision = Precision::kDouble;
  NewtonConfig newton;
  SpaceConfig space;
  SleepConfig sleep;
  std::optional<ExampleForceConfig> examples;  ///< force on the whole body
  std::vector<RegionForceConfig> regions;
  std::vector<VertexForceConfig> forces;
  BodyConfig body;
  std::optional<ReachConfig> reach;
  std::vector<AttachmentConfig> attachments;
  std::vector<ObstacleConfig> obstacles;  ///< none: no contact
  MeetingGroup meeting;
  bool meets_others = false;  ///< contact with obstacles and bodies that a host adds; no file sets it
  bool meets_bodies = false;  ///< other bodies or parts of itself may touch or hold it; no file sets it
  std::string place;          ///< JSON pointer that forces, regions and body are below; empty: the root
  int instances = 1;          ///< bodies that are stepped; the trajectory shows the first
  std::optional<std::filesystem::path> trajectory;
  std::int64_t every = 10;
  bool render = false;  ///< the trajectory holds the render mesh
};

/// JSON pointer of the first setting with keys; empty where there is none.
std::string place_of_keys(const SceneConfig& scene);

/// Law of contact between bodies; all per area of their surfaces.
struct BodyContactConfig {
  double stiffness = 1e6;  ///< pressure per depth [N/m^3]
  double damping = 0;      ///< pressure per approach velocity [N s/m^3]
  double friction = 0;     ///< Coulomb's coefficient
  bool self = false;       ///< parts of one body, too
  double release = 1;      ///< speed at which overlap at the start is let out, obstacles included [m/s]
};

/// Place of a body beyond what its BodyConfig says.
struct BodyPlace {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< unit
};

/// Bodies of one kind: what a scene of one of them would say.
struct BodiesConfig {
  std::string name;
  SceneConfig scene;  ///< with what holds for all bodies
  std::vector<BodyPlace> places;
};

/// All bodies of a scene. One that names a single bundle has one kind, without a name, in `instances` places: these
/// touch obstacles and not each other.
struct WorldConfig {
  std::filesystem::path file;
  bool is_list = true;       ///< the file lists its bodies; false: it names a single bundle
  double time_step = 0.001;  ///< [s]
  std::int64_t steps = 1000;
  std::vector<BodiesConfig> bodies;
  BodyContactConfig contact;
  int full_bodies = 1000000;  ///< most bodies of space `auto` that step in all vertices at once
  std::optional<std::filesystem::path> trajectory;
  std::int64_t every = 10;
};

/// The forces of a scene with their vertices, those that it names by place chosen from the points of its body. Throws
/// InputError (see select_points) with the place in the scene.
std::vector<VertexForceConfig> forces_on_vertices(const SceneConfig& config, SelectablePoints points);

}  // namespace exmat
