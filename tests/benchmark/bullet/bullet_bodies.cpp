#include "tests/benchmark/bullet/bullet_bodies.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletSoftBody/BulletReducedDeformableBody/btReducedDeformableBody.h>
#include <BulletSoftBody/BulletReducedDeformableBody/btReducedDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <algorithm>
#include <btBulletDynamicsCommon.h>
#include <cmath>
#include <vector>

#include "common/core/decompositions.h"

namespace exmat::benchmarks {
namespace {

constexpr double kMargin = 1e-3;         // of collision shapes [m]
constexpr double kFloorThickness = 0.5;  // half of it [m]
constexpr double kFloorReach = 20;       // half of its length and width [m]

btVector3 vector_of(const Eigen::Vector3d& v) {
  return {static_cast<btScalar>(v[0]), static_cast<btScalar>(v[1]), static_cast<btScalar>(v[2])};
}

}  // namespace

struct BulletBodies::World {
  World(const test::Bar& its_bar, const Settings& its_settings) : bar(its_bar), settings(its_settings) {
    const Eigen::MatrixXd reduced = bar.basis().transpose() * bar.stiffness * bar.basis();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(reduced);
    stiffness = eigen.eigenvalues();
    modes = bar.basis() * eigen.eigenvectors();
    constraints.setDeformableSolver(&solver);
    dynamics = std::make_unique<btDeformableMultiBodyDynamicsWorld>(&dispatcher, &broadphase, &constraints,
                                                                    &configuration, &solver);
    dynamics->setGravity({0, 0, static_cast<btScalar>(-settings.gravity)});
    dynamics->setImplicit(false);
    dynamics->setLineSearch(false);
    dynamics->setUseProjection(false);
    btContactSolverInfo& info = dynamics->getSolverInfo();
    info.m_deformable_erp = btScalar(0.2);
    info.m_deformable_cfm = btScalar(0.2);
    info.m_friction = static_cast<btScalar>(settings.friction);
    info.m_deformable_maxErrorReduction = btScalar(200);
    info.m_leastSquaresResidualThreshold = btScalar(1e-6);
    info.m_splitImpulse = false;
    info.m_numIterations = 200;
    if (settings.floor) add_floor();
  }
  ~World() {
    for (const auto& body : bodies) dynamics->removeSoftBody(body.get());
    if (floor) dynamics->removeRigidBody(floor.get());
  }

  void add_floor() {
    floor_shape = std::make_unique<btBoxShape>(vector_of({kFloorReach, kFloorReach, kFloorThickness}));
    floor_shape->setMargin(btScalar(kMargin));
    floor = std::make_unique<btRigidBody>(btScalar(0), nullptr, floor_shape.get());
    btTransform place = btTransform::getIdentity();
    place.setOrigin({0, 0, btScalar(-kFloorThickness)});
    floor->setWorldTransform(place);
    floor->setFriction(static_cast<btScalar>(settings.friction));
    dynamics->addRigidBody(floor.get());
  }

  const test::Bar& bar;
  Settings settings;
  Eigen::VectorXd stiffness;  // of the modes
  Eigen::MatrixXd modes;      // 3n x r
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btReducedDeformableBodySolver solver;
  btDeformableMultiBodyConstraintSolver constraints;
  std::unique_ptr<btDeformableMultiBodyDynamicsWorld> dynamics;
  std::unique_ptr<btBoxShape> floor_shape;
  std::unique_ptr<btRigidBody> floor;
  std::vector<std::unique_ptr<btReducedDeformableBody>> bodies;
};

BulletBodies::BulletBodies(const test::Bar& bar, const Settings& settings)
    : world_(std::make_unique<World>(bar, settings)) {}

BulletBodies::~BulletBodies() = default;

void BulletBodies::add(const Eigen::Vector3d& by, const Eigen::Vector3d& spin) {
  const TetMesh& mesh = world_->bar.model.object->mesh;
  const auto vertices = static_cast<int>(mesh.vertices.rows());
  const auto count = static_cast<int>(world_->stiffness.size());
  std::vector<btVector3> places;
  for (int v = 0; v < vertices; ++v) places.push_back(vector_of(mesh.vertices.row(v)));
  auto body =
      std::make_unique<btReducedDeformableBody>(&world_->dynamics->getWorldInfo(), vertices, places.data(), nullptr);
  Eigen::VectorXd masses = Eigen::VectorXd::Zero(vertices);  // rows of the consistent mass matrix summed up
  for (int v = 0; v < vertices; ++v) masses[v] = world_->bar.mass.row(3 * v).sum();
  for (Eigen::Index t = 0; t < mesh.tets.rows(); ++t)
    body->appendTetra(mesh.tets(t, 0), mesh.tets(t, 1), mesh.tets(t, 2), mesh.tets(t, 3));
  btSoftBodyHelpers::generateBoundaryFaces(body.get());
  body->initializeDmInverse();
  body->m_tetraScratches.resize(body->m_tetras.size());
  body->m_tetraScratchesTn.resize(body->m_tetras.size());
  body->setReducedModes(count, vertices);
  body->m_eigenvalues.resize(count);
  body->m_Kr.resize(count);
  body->m_modes.resize(count);
  for (int j = 0; j < count; ++j) {
    body->m_eigenvalues[j] = body->m_Kr[j] = static_cast<btScalar>(world_->stiffness[j]);
    body->m_modes[j].resize(3 * vertices);
    for (int i = 0; i < 3 * vertices; ++i) body->m_modes[j][i] = static_cast<btScalar>(world_->modes(i, j));
  }
  btReducedDeformableBody::tDenseArray mass_of;
  mass_of.resize(vertices);
  for (int v = 0; v < vertices; ++v) mass_of[v] = static_cast<btScalar>(masses[v]);
  body->setMassProps(mass_of);
  body->setInertiaProps();
  body->internalInitialization();
  body->disableReducedModes(false);
  world_->dynamics->addSoftBody(body.get());
  body->getCollisionShape()->setMargin(btScalar(kMargin));
  btTransform moved = btTransform::getIdentity();
  moved.setOrigin(vector_of(by));
  body->transform(moved);
  body->setRigidAngularVelocity(vector_of(spin));
  const BulletBodies::Settings& settings = world_->settings;
  body->setDamping(static_cast<btScalar>(settings.mass_damping), static_cast<btScalar>(settings.stiffness_damping));
  body->m_cfg.kKHR = 1;
  body->m_cfg.kCHR = 1;
  body->m_cfg.kDF = static_cast<btScalar>(settings.friction);
  body->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN;
  body->m_sleepingThreshold = 0;
  body->setActivationState(DISABLE_DEACTIVATION);
  world_->bodies.push_back(std::move(body));
}

void BulletBodies::step() {
  const auto dt = static_cast<btScalar>(world_->settings.time_step);
  world_->dynamics->stepSimulation(dt, 0, dt);
}

double BulletBodies::highest_frequency() const { return std::sqrt(world_->stiffness.maxCoeff()); }

double BulletBodies::lowest(int body) const {
  const btReducedDeformableBody& own = *world_->bodies[static_cast<std::size_t>(body)];
  btScalar lowest = own.m_nodes[0].m_x[2];
  for (int v = 1; v < own.m_nodes.size(); ++v) lowest = std::min(lowest, own.m_nodes[v].m_x[2]);
  return lowest;
}

Eigen::Vector3d BulletBodies::centre(int body) const {
  const btVector3& origin = world_->bodies[static_cast<std::size_t>(body)]->getRigidTransform().getOrigin();
  return {origin[0], origin[1], origin[2]};
}

int BulletBodies::touching() const {
  int count = 0;
  for (const auto& body : world_->bodies) count += body->m_nodeRigidContacts.size();
  return count;
}

}  // namespace exmat::benchmarks
