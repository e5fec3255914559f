/*
 * exmat in other programs: load a bundle once, step any number of bodies of it, push and read any of their points.
 * C99, and the one binary interface of libexmat_runtime: exmat.hpp wraps it for C++. docs/embedding.md has a program.
 *
 * Units: SI, world frame. Shapes: row-major, x y z of one point after another. r modes, K examples, n vertices.
 *
 * Errors: a function that can fail returns a status; the message of the last failure of this thread is
 * exmat_last_error(). Then nothing has changed, and what would have been created is NULL. NULL for an argument that is
 * not said to allow it, and a length that does not fit, are EXMAT_INVALID_ARGUMENT. Lengths count numbers, not points
 * or bytes.
 *
 * Memory: only ..._create... functions allocate (and those of states, of obstacles and of the bodies of worlds, those
 * that say so, and the first exmat_world_step() with more threads than before, which starts them). What they create is
 * the caller's, to be given to the matching ..._destroy, in any order: a body or a set of points keeps what it needs of
 * its model.
 * ..._destroy(NULL) does nothing.
 *
 * Threads: models and points never change: any number of threads may use them. A body is for one thread at a time.
 * ..._create... functions may be called from any thread and take turns.
 */
#ifndef EXMAT_EXMAT_H
#define EXMAT_EXMAT_H

#include <stddef.h>
#include <stdint.h>

/* NOLINTBEGIN(readability-identifier-naming): names of a C library */

#if defined(_WIN32) && defined(exmat_runtime_EXPORTS) /* CMake defines it where it makes the DLL */
#define EXMAT_API __declspec(dllexport)
#elif defined(__GNUC__) && !defined(_WIN32)
#define EXMAT_API __attribute__((visibility("default")))
#else
#define EXMAT_API
#endif

#ifdef __cplusplus
#define EXMAT_NOEXCEPT noexcept
extern "C" {
#else
#define EXMAT_NOEXCEPT
#endif

typedef enum exmat_status {
  EXMAT_OK = 0,
  EXMAT_FAILURE = 1,          /* out of memory, a file that cannot be read to its end, ... */
  EXMAT_BAD_INPUT = 2,        /* a bundle or scene; the message has file, place, expected, found and advice */
  EXMAT_INVALID_ARGUMENT = 3, /* of a function */
  EXMAT_NON_FINITE = 4        /* a step met NaN or infinity: the body is as it was before that step */
} exmat_status;

/* Message of this thread's last failure, "" before the first; valid until the next one. */
EXMAT_API const char* exmat_last_error(void) EXMAT_NOEXCEPT;

/* Version of the library: "0.1.0". */
EXMAT_API const char* exmat_version(void) EXMAT_NOEXCEPT;

/* ---- models ---------------------------------------------------------------------------------------------------- */

/* A bundle prepared for stepping, and what acts on its bodies. */
typedef struct exmat_model exmat_model;

enum { EXMAT_BDF2 = 0, EXMAT_BACKWARD_EULER = 1, EXMAT_NEWMARK = 2 };             /* integrator */
enum { EXMAT_INTERNAL_FORCE_AUTO = 0, EXMAT_CUBATURE = 1, EXMAT_POLYNOMIAL = 2 }; /* internal_force */
enum { EXMAT_TARGET_AUTO = 0, EXMAT_TARGET_TABLE = 1, EXMAT_TARGET_SOLVE = 2 };   /* example_target */
enum { EXMAT_ENERGY_REFERENCE_EXAMPLE = 0, EXMAT_ENERGY_REFERENCE_REST = 1 };     /* energy_reference */

enum { EXMAT_PRECISION_DOUBLE = 0, EXMAT_PRECISION_MIXED = 1 };               /* precision */
enum { EXMAT_SPACE_REDUCED = 0, EXMAT_SPACE_FULL = 1, EXMAT_SPACE_AUTO = 2 }; /* space */

/* The members of a scene file that belong to a model; schemas/scene.json says what each is. */
typedef struct exmat_settings {
  size_t size;               /* sizeof(exmat_settings) where the caller was compiled */
  double time_step;          /* > 0 [s]; 0.001 */
  double gravity[3];         /* [m/s^2]; 0 */
  double mass_damping;       /* alpha >= 0 [1/s]; 0 */
  double stiffness_damping;  /* beta >= 0 [s]; 0 */
  double newton_tolerance;   /* in (0, 1), relative; 1e-6 */
  double example_stiffness;  /* kappa >= 0 [1/s^2]; 0. All of examples: with use_examples */
  double example_damping;    /* c_kappa >= 0 [1/s]; 0 */
  double example_bias;       /* in [0, 1], factor on the weight of the rest pose; 1 */
  int32_t newton_iterations; /* most in one step, 1 to 10000; 200 */
  int32_t integrator;        /* EXMAT_BDF2 */
  int32_t internal_force;    /* EXMAT_INTERNAL_FORCE_AUTO: as the bundle says */
  int32_t use_examples;      /* 1: example force; 0 */
  int32_t example_target;    /* EXMAT_TARGET_AUTO: by the table where the bundle has one */
  int32_t target_iterations; /* most in one step, 1 to 1000; 4 */
  int32_t energy_reference;  /* EXMAT_ENERGY_REFERENCE_EXAMPLE */
  int32_t use_contact;       /* 1: bodies can touch obstacles and each other; 0 */
  double sleep_energy;       /* > 0: a body is left alone once its kinetic energy has been below this [J]; 0: never.
                                Bodies that touch each other fall asleep and wake together */
  double sleep_time;         /* for so long, > 0 [s]; 0.5 */
  int32_t precision;         /* EXMAT_PRECISION_DOUBLE; of bodies that go side by side, exmat_world_step() */
  int32_t space;        /* EXMAT_SPACE_REDUCED: steps in the modes of the bundle; _FULL: in all vertices of its mesh,
                           right under any load; _AUTO: in all vertices while forces of the caller act or obstacles
                           touch, in the modes else. The last two let exmat_body_set_space() change it */
  double space_release; /* how long _AUTO stays in all vertices after the last such load, > 0 [s]; 0.5 */
} exmat_settings;

/* Sets all members to their defaults; `size` is sizeof(exmat_settings). */
EXMAT_API exmat_status exmat_settings_default(exmat_settings* settings, size_t size) EXMAT_NOEXCEPT;

/* Loads a bundle or a pack of one, as far as the settings need it; `settings` NULL: the defaults. */
EXMAT_API exmat_status exmat_model_create(const char* bundle_path, const exmat_settings* settings,
                                          exmat_model** model) EXMAT_NOEXCEPT;

/* Loads a pack of a bundle, which `exmat-runtime pack` writes, from `size` bytes of memory, with no file. The library
   keeps a copy, of which points are made later: `data` may be freed on return. It need not be aligned. */
EXMAT_API exmat_status exmat_model_create_from_memory(const void* data, size_t size, const exmat_settings* settings,
                                                      exmat_model** model) EXMAT_NOEXCEPT;

/* Loads a scene file and its bundle, scripted forces included; its steps, instances and output are ignored. */
EXMAT_API exmat_status exmat_model_create_from_scene(const char* scene_path, exmat_model** model) EXMAT_NOEXCEPT;

/* The same of the text of a scene file; `path` names it in messages, and names in it are relative to that path's
   folder. `use_contact` 1: bodies can touch obstacles and each other also where the scene has no obstacles. */
EXMAT_API exmat_status exmat_model_create_from_text(const char* scene, const char* path, int32_t use_contact,
                                                    exmat_model** model) EXMAT_NOEXCEPT;

EXMAT_API void exmat_model_destroy(exmat_model* model) EXMAT_NOEXCEPT;

/* Negative where `model` is NULL. */
EXMAT_API int64_t exmat_model_modes(const exmat_model* model) EXMAT_NOEXCEPT;    /* r */
EXMAT_API int64_t exmat_model_vertices(const exmat_model* model) EXMAT_NOEXCEPT; /* n */
EXMAT_API int64_t exmat_model_examples(const exmat_model* model)
    EXMAT_NOEXCEPT; /* K of the whole body; 0 without its example force */
/* The regions with a local example force that the scene names, in its order, and of region 0, 1, ... its K and its
   name. Negative and NULL where `model` is NULL or has no such region. */
EXMAT_API int64_t exmat_model_regions(const exmat_model* model) EXMAT_NOEXCEPT;
EXMAT_API int64_t exmat_model_region_examples(const exmat_model* model, int64_t region) EXMAT_NOEXCEPT;
EXMAT_API const char* exmat_model_region_name(const exmat_model* model, int64_t region) EXMAT_NOEXCEPT;
EXMAT_API double exmat_model_time_step(const exmat_model* model) EXMAT_NOEXCEPT; /* [s] */
/* Hash of the bundle's inputs, 64 hexadecimal digits: equal where its arrays are. NULL where `model` is NULL. */
EXMAT_API const char* exmat_model_input_sha256(const exmat_model* model) EXMAT_NOEXCEPT;

/* ---- points ---------------------------------------------------------------------------------------------------- */

/* k material points of a model's body, in the order given. */
typedef struct exmat_points exmat_points;

/* Vertices of the object, 0-based `ids` [count], count >= 1; repeated ones are allowed. */
EXMAT_API exmat_status exmat_points_create_vertices(const exmat_model* model, const int64_t* ids, int64_t count,
                                                    exmat_points** points) EXMAT_NOEXCEPT;

/* All vertices, in single precision: to be read, not to be pushed. */
EXMAT_API exmat_status exmat_points_create_all_vertices(const exmat_model* model, exmat_points** points) EXMAT_NOEXCEPT;

/* Points of the rest shape `xyz` [coordinates = 3k] [m], k >= 1: each moves with the tet that holds it, or with the
   nearest one, continued linearly, where none does. */
EXMAT_API exmat_status exmat_points_create_at(const exmat_model* model, const double* xyz, int64_t coordinates,
                                              exmat_points** points) EXMAT_NOEXCEPT;

EXMAT_API void exmat_points_destroy(exmat_points* points) EXMAT_NOEXCEPT;

/* k; negative where `points` is NULL. */
EXMAT_API int64_t exmat_points_count(const exmat_points* points) EXMAT_NOEXCEPT;

/* `distances` [count = k]: from each point to the object at rest, 0 inside [m]. */
EXMAT_API exmat_status exmat_points_distances(const exmat_points* points, double* distances,
                                              int64_t count) EXMAT_NOEXCEPT;

/* ---- bodies ---------------------------------------------------------------------------------------------------- */

/* Bodies of any models with the same time step, stepped together: they may touch each other and the world's obstacles.
   All have the time of the world. Those that touch each other are solved together; of the others those of one model are
   stepped eight at a time, side by side in the lanes of registers. All functions of a body serve bodies of a world,
   too, but for exmat_body_step(). A world is for one thread at a time, and so are its bodies. */
typedef struct exmat_world exmat_world;

/* One body: its state and the forces on it. It is always in a world: in one of its own, which has the obstacles of the
   model's scene, or in one that exmat_world_add_body() put it into. */
typedef struct exmat_body exmat_body;

/* At rest at time 0. */
EXMAT_API exmat_status exmat_body_create(const exmat_model* model, exmat_body** body) EXMAT_NOEXCEPT;
EXMAT_API void exmat_body_destroy(exmat_body* body) EXMAT_NOEXCEPT;

/* The model that it was made of, as a handle of the caller's own. */
EXMAT_API exmat_status exmat_body_model(const exmat_body* body, exmat_model** model) EXMAT_NOEXCEPT;

/* Back to rest, without applied forces, at time 0; in a world with others at the time of the world. */
EXMAT_API exmat_status exmat_body_reset(exmat_body* body) EXMAT_NOEXCEPT;

/* As reset, at the reduced displacement `q` with the velocity `v`, [modes = r] each. */
EXMAT_API exmat_status exmat_body_set_reduced(exmat_body* body, const double* q, const double* v,
                                              int64_t modes) EXMAT_NOEXCEPT;

/* Bits of exmat_report.status. */
enum {
  EXMAT_STEP_NON_FINITE = 1,
  EXMAT_STEP_ITERATION_LIMIT = 2,      /* the residual is above the tolerance */
  EXMAT_STEP_STAGNATED = 4,            /* likewise, and no descent is left: rounding */
  EXMAT_STEP_TARGET_NOT_CONVERGED = 8, /* the next step carries on */
  EXMAT_STEP_SUBNORMAL = 16,           /* no fault: numbers below 2.2e-308 were set to zero */
  EXMAT_STEP_ASLEEP = 32,              /* no fault: the body rests, see sleep_energy; its contacts are not told */
  EXMAT_STEP_DIVIDED = 64              /* no fault: it had no solution in one step, and took several smaller ones */
};

/* Results of the steps of one call: sums, unless said otherwise. */
typedef struct exmat_report {
  size_t size;     /* sizeof(exmat_report), set by the caller */
  int64_t steps;   /* taken; fewer than asked for only with EXMAT_NON_FINITE */
  uint32_t status; /* bits of all steps */
  uint32_t reserved;
  int64_t newton_iterations;
  int64_t factorisations;
  int64_t line_search_evaluations;
  int64_t projections;
  int64_t target_iterations;
  double residual; /* of the equation of motion at the end of the last step [kg^1/2 m/s^2] */
  double seconds;  /* wall clock */
  /* Lost work, in [0, 1], of the applied forces and of contacts as they are at the end of the call; negative where it
     is not measured: exmat_body_set_capacity(). */
  double lost_applied, lost_contact;
} exmat_report;

/* Takes `steps` >= 0 steps of a body in a world of its own, fewer with EXMAT_NON_FINITE. `report` may be NULL. */
EXMAT_API exmat_status exmat_body_step(exmat_body* body, int64_t steps, exmat_report* report) EXMAT_NOEXCEPT;

/* Reads the report of the last call that stepped this body. */
EXMAT_API exmat_status exmat_body_read_report(const exmat_body* body, exmat_report* report) EXMAT_NOEXCEPT;

/* Adds `forces` [coordinates = 3k] [N] on the points, constant in the world, to those that act in every step from now
   on. Points of another model and forces that are not finite, or above 1e30, are refused. A free body's forces act at
   where the points are when this is called: their sum and their torque about the centre of mass stay in the world, what
   they do to the shape turns with the body. Call it again as the body moves. */
EXMAT_API exmat_status exmat_body_apply_forces(exmat_body* body, const exmat_points* points, const double* forces,
                                               int64_t coordinates) EXMAT_NOEXCEPT;
/* Ends all applied forces, those with an id included. */
EXMAT_API exmat_status exmat_body_clear_forces(exmat_body* body) EXMAT_NOEXCEPT;

/* Adds forces likewise, with an `id` by which they can be changed and removed while all others stay to the last bit: a
   hand, a wind, a thruster each have their own. No later forces of the body have the same id. Allocates. It ends with
   exmat_body_clear_forces(), a reset, and a state that the body takes, which holds the sum of all forces; snapshots of
   worlds keep it. */
EXMAT_API exmat_status exmat_body_add_forces(exmat_body* body, const exmat_points* points, const double* forces,
                                             int64_t coordinates, int64_t* id) EXMAT_NOEXCEPT;

/* Puts these forces, on these points, in place of those that had the id. The body then is as if it had got these. An id
   whose forces do not act is refused. */
EXMAT_API exmat_status exmat_body_set_forces(exmat_body* body, int64_t id, const exmat_points* points,
                                             const double* forces, int64_t coordinates) EXMAT_NOEXCEPT;

/* Ends the forces of the id. The body then is as if it had never got them: not a bit of the sum of the others is left
   changed. An id whose forces do not act is refused. */
EXMAT_API exmat_status exmat_body_remove_forces(exmat_body* body, int64_t id) EXMAT_NOEXCEPT;

/* Motion of a free body as a whole, world frame: displacement of the centre of mass from rest [m], unit quaternion (w
   first), velocity of the centre of mass [m/s] and angular velocity [rad/s]. None is set that is above 1e30. */
typedef struct exmat_motion {
  size_t size; /* sizeof(exmat_motion), set by the caller */
  double position[3];
  double orientation[4];
  double linear_velocity[3];
  double angular_velocity[3];
} exmat_motion;

/* That of a body with fixed vertices is the motion that its scene carries them along: position and velocity of the
   origin of the moving frame; rest where there is none. */
EXMAT_API exmat_status exmat_body_read_motion(const exmat_body* body, exmat_motion* motion) EXMAT_NOEXCEPT;

/* Free bodies only; the shape and how fast it changes stay. What friction holds it by goes with the body. The
   quaternion is normalised. */
EXMAT_API exmat_status exmat_body_set_motion(exmat_body* body, const exmat_motion* motion) EXMAT_NOEXCEPT;

/* To be called after forces have changed abruptly: the next step then takes nothing from the ones before but position
   and velocity, as where a scene's scripted force begins or ends, so that the impulse is exact. Forces that follow
   something smooth do without. */
EXMAT_API exmat_status exmat_body_restart_integrator(exmat_body* body) EXMAT_NOEXCEPT;

/* Compliance of the points in one step, about [m/N]: the way of their mean by a force of 1 N that is shared equally by
   them, of a body that was last stepped in all vertices (EXMAT_SPACE_FULL), else 0. A spring of a host, whose force is
   that of the step before, is stable with a stiffness well below its inverse. */
EXMAT_API exmat_status exmat_body_read_point_compliance(const exmat_body* body, const exmat_points* points,
                                                        double* compliance) EXMAT_NOEXCEPT;

/* World positions `xyz` [coordinates = 3k] [m] in single precision; of all vertices as fast as memory is read. */
EXMAT_API exmat_status exmat_body_read_positions(exmat_body* body, const exmat_points* points, float* xyz,
                                                 int64_t coordinates) EXMAT_NOEXCEPT;

/* The same in double precision; not of exmat_points_create_all_vertices(). */
EXMAT_API exmat_status exmat_body_read_positions_double(const exmat_body* body, const exmat_points* points, double* xyz,
                                                        int64_t coordinates) EXMAT_NOEXCEPT;

/* Reduced displacement `q` and velocity `v`, [modes = r] each; either may be NULL. */
EXMAT_API exmat_status exmat_body_read_reduced(const exmat_body* body, double* q, double* v,
                                               int64_t modes) EXMAT_NOEXCEPT;

/* Example weights [count = K] of the last step, after the bias. */
EXMAT_API exmat_status exmat_body_read_weights(const exmat_body* body, double* weights, int64_t count) EXMAT_NOEXCEPT;

/* The same of a region, 0 <= region < exmat_model_regions(). */
EXMAT_API exmat_status exmat_body_read_region_weights(const exmat_body* body, int64_t region, double* weights,
                                                      int64_t count) EXMAT_NOEXCEPT;

/* The arrays themselves: reduced displacement q and velocity v [r], example weights [K]. They stay where they are as
   long as the body, and change with it; the caller does not write into them. NULL where `body` is NULL, and of the
   weights where K = 0. */
EXMAT_API const double* exmat_body_displacement(const exmat_body* body) EXMAT_NOEXCEPT;
EXMAT_API const double* exmat_body_velocity(const exmat_body* body) EXMAT_NOEXCEPT;
EXMAT_API const double* exmat_body_weights(const exmat_body* body) EXMAT_NOEXCEPT;

/* Energies at the end of the last step. */
typedef struct exmat_energies {
  size_t size;      /* sizeof(exmat_energies), set by the caller */
  double kinetic;   /* of the body in the world [J] */
  double elastic;   /* [J] */
  double potential; /* of gravity, 0 at rest [J] */
  double contact;   /* of a world: the springs of contacts and attachments between its bodies [J] */
} exmat_energies;
EXMAT_API exmat_status exmat_body_read_energies(const exmat_body* body, exmat_energies* energies) EXMAT_NOEXCEPT;

/* Time of the body: its steps times the time step [s]; negative where `body` is NULL. */
EXMAT_API double exmat_body_time(const exmat_body* body) EXMAT_NOEXCEPT;

/* ---- settings of one body -------------------------------------------------------------------------------------- */

/* Settings of this body in place of the model's, until set again; exmat_body_reset() keeps them. What the scene keys in
   time, its keys set again before each step. A state does not hold them. They may change between any two steps; after
   an abrupt change exmat_body_restart_integrator() keeps impulses exact. */

/* `gravity` [3], world [m/s^2]. */
EXMAT_API exmat_status exmat_body_set_gravity(exmat_body* body, const double* gravity) EXMAT_NOEXCEPT;

/* Rayleigh damping: alpha >= 0 [1/s] of the mass, beta >= 0 [s] of the stiffness, at most 1e30. */
EXMAT_API exmat_status exmat_body_set_damping(exmat_body* body, double alpha, double beta) EXMAT_NOEXCEPT;

/* EXMAT_BDF2, ...; the next step takes nothing from the ones before but position and velocity. */
EXMAT_API exmat_status exmat_body_set_integrator(exmat_body* body, int32_t integrator) EXMAT_NOEXCEPT;

/* EXMAT_SPACE_...; from the next step on. Positions and momenta stay, but for what the modes cannot hold when the body
   leaves the full space. The model has to be of space _FULL or _AUTO. What holds a body holds it in its modes or in the
   others: detach it before a change. */
EXMAT_API exmat_status exmat_body_set_space(exmat_body* body, int32_t space) EXMAT_NOEXCEPT;

/* The space that the last step was in: EXMAT_SPACE_REDUCED or EXMAT_SPACE_FULL; negative where `body` is NULL. */
EXMAT_API int32_t exmat_body_space(const exmat_body* body) EXMAT_NOEXCEPT;

/* Bodies on a skeleton, of surfaces with a skin or of tets whose asset names bones. Such a body steps in all vertices
   of its mesh: those that hang on one bone alone go exactly where it goes, all others are flesh. A bone's transform
   [12] takes it to the world: a 3 x 4 matrix by rows, its last column the joint [m], as the world matrix of its node in
   glTF; where axes are stretched the nearest rotation is taken. */

/* Number of bones, and of animations; 0 without a skeleton, negative where `model` is NULL. */
EXMAT_API int64_t exmat_model_bones(const exmat_model* model) EXMAT_NOEXCEPT;
EXMAT_API int64_t exmat_model_animations(const exmat_model* model) EXMAT_NOEXCEPT;

/* NULL where there is none, and owned by the model. */
EXMAT_API const char* exmat_model_bone_name(const exmat_model* model, int64_t bone) EXMAT_NOEXCEPT;
EXMAT_API const char* exmat_model_animation_name(const exmat_model* model, int64_t animation) EXMAT_NOEXCEPT;

/* -1 of a root. Parents come before their children. */
EXMAT_API int64_t exmat_model_bone_parent(const exmat_model* model, int64_t bone) EXMAT_NOEXCEPT;

/* [s]; negative where there is none. */
EXMAT_API double exmat_model_animation_duration(const exmat_model* model, int64_t animation) EXMAT_NOEXCEPT;

/* Transforms of all bones where the mesh is at rest, and at a time of an animation, which is held at its ends.
   `count`: 12 times the bones. */
EXMAT_API exmat_status exmat_model_read_bones(const exmat_model* model, double* transforms,
                                              int64_t count) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_model_read_animation(const exmat_model* model, int64_t animation, double time,
                                                  double* transforms, int64_t count) EXMAT_NOEXCEPT;

/* Where the bones are at the end of the next step, and of those after it until the next call, in place of the scene's
   animation. Velocities come from where they were. `teleport`: not 0 puts the body there at once, at rest beside its
   bones, without a motion from where it was; the first call of a body does so in any case. `bones`: their number. */
EXMAT_API exmat_status exmat_body_set_bones(exmat_body* body, const double* transforms, int64_t bones,
                                            int32_t teleport) EXMAT_NOEXCEPT;

/* Transforms of all bones at the end of the last step. */
EXMAT_API exmat_status exmat_body_read_bones(const exmat_body* body, double* transforms, int64_t count) EXMAT_NOEXCEPT;

/* Attachments: a frame of the host, such as a rigid body, a bone or a hand, holds a patch of a body. What is held is
   exactly where the frame is at the end of each step; the frame's transform [12] is as a bone's. A body of space _AUTO
   steps in all vertices of its mesh for as long as something holds it. */
enum {
  EXMAT_ATTACHMENT_FIXED = 0, /* each vertex of the patch stays where it is in the frame; of a body of space _REDUCED,
                                 their mean by mass and the rotation that fits the patch best do: 6 conditions, 5 of
                                 vertices in a line, 3 of one; less than half a turn in a step */
  EXMAT_ATTACHMENT_BALL = 1,  /* their mean does, by their masses; the patch turns about it */
  EXMAT_ATTACHMENT_SPRING = 2 /* a spring and a damper pull that mean to where it is in the frame */
};
typedef struct exmat_attachment {
  size_t size;        /* sizeof(exmat_attachment), set by the caller */
  int32_t kind;       /* EXMAT_ATTACHMENT_FIXED */
  double stiffness;   /* of a spring, > 0 [N/m]; 1e4 */
  double damping;     /* likewise, >= 0 [N s/m]; 0 */
  double break_force; /* beyond which it holds no longer, > 0 [N]; infinity */
} exmat_attachment;

/* Sets all members to their defaults; `size` is sizeof(exmat_attachment). */
EXMAT_API exmat_status exmat_attachment_default(exmat_attachment* attachment, size_t size) EXMAT_NOEXCEPT;

/* From the next step on, by where `vertices` [count] of the object are now in the frame. None of them may be fixed, or
   held already. `id` of the attachment is the body's own; those that a scene gives it have the ids 0, 1, ... in the
   scene's order, those to other bodies last, and are there again after a reset. Of a body of space _REDUCED the bundle
   is read; its modes have to be able to hold the patch. */
EXMAT_API exmat_status exmat_body_attach(exmat_body* body, const int64_t* vertices, int64_t count,
                                         const exmat_attachment* attachment, const double* frame,
                                         int64_t* id) EXMAT_NOEXCEPT;

/* Attaches the body to `other_vertices` [other_count] of another body of its world, from where both are now: that
   patch, with its mean and the rotation that fits it best, is the frame. What acts on one body acts on the other
   with the opposite sign. `id` as above. Both step in their modes (space _REDUCED) in a world without law.apart; they
   do not touch each other while the attachment holds. Of _FIXED both patches have three vertices or more that are not
   in a line. Reads the bundles. exmat_body_detach() lets go, and so does taking one of the two out of the world. */
EXMAT_API exmat_status exmat_body_attach_to(exmat_body* body, const int64_t* vertices, int64_t count, exmat_body* other,
                                            const int64_t* other_vertices, int64_t other_count,
                                            const exmat_attachment* attachment, int64_t* id) EXMAT_NOEXCEPT;

/* Puts the frame where it is at the end of the next step, and of those after it until the next call; one of a scene
   follows neither its motion nor its obstacle from then on. */
EXMAT_API exmat_status exmat_body_move_attachment(exmat_body* body, int64_t id, const double* frame) EXMAT_NOEXCEPT;

/* Lets the patch go. */
EXMAT_API exmat_status exmat_body_detach(exmat_body* body, int64_t id) EXMAT_NOEXCEPT;

/* Reads what the body exerts on the frame in the last step: `force` [3] [N] and `torque` [3] about the frame's origin
   [N m]; on another body about the point that holds the mean of the patch. `broken`: 1 where that was more than the
   attachment bears. Each may be NULL. */
EXMAT_API exmat_status exmat_body_read_attachment_load(const exmat_body* body, int64_t id, double* force,
                                                       double* torque, int32_t* broken) EXMAT_NOEXCEPT;

/* Impulses: a host that solves its own joints and contacts takes the body as a thing of these velocities and this
   inverse mass between two steps, and gives it the impulses that it found, as often as it likes. One of space `auto`
   then steps in all its vertices, until it was left alone. */

/* World `velocity` [coordinates = 3k] [m/s] of the points at the end of the last step, and `compliance` [3k x 3k, by
   rows] [1/kg]: the change of these velocities by an impulse of 1 N s on each coordinate, W = J A^-1 J^T with the mass,
   damping and stiffness of a step in A and what frames hold by hard attachments held; contacts and attachments to
   other bodies are left out. Each may be NULL. */
EXMAT_API exmat_status exmat_body_read_compliance(const exmat_body* body, const exmat_points* points, double* velocity,
                                                  double* compliance, int64_t coordinates) EXMAT_NOEXCEPT;

/* Gives the points impulses [coordinates = 3k] [N s], world: their velocities change by W times these, the body moves
   on by that times the time step, and the momenta of a free one change by exactly these impulses. */
EXMAT_API exmat_status exmat_body_apply_impulses(exmat_body* body, const exmat_points* points, const double* impulses,
                                                 int64_t coordinates) EXMAT_NOEXCEPT;

/* Settings of the example force. `region`: -1 is the whole body, else as in exmat_body_read_region_weights(). The model
   has to have that example force: use_examples, or the scene. */

/* kappa >= 0, at most 1e30 [1/s^2]. */
EXMAT_API exmat_status exmat_body_set_example_stiffness(exmat_body* body, int64_t region, double kappa) EXMAT_NOEXCEPT;

/* c_kappa >= 0, at most 1e30 [1/s]; not of an elastic force. */
EXMAT_API exmat_status exmat_body_set_example_damping(exmat_body* body, int64_t region, double c_kappa) EXMAT_NOEXCEPT;

/* In [0, 1]: factor on the weight of the rest pose. */
EXMAT_API exmat_status exmat_body_set_example_bias(exmat_body* body, int64_t region, double bias) EXMAT_NOEXCEPT;

/* Weights [count = K], none negative, of sum 1 to 1e-9, instead of those of the pose; the bias does not act on them.
   NULL with count 0: those of the pose again. */
EXMAT_API exmat_status exmat_body_set_example_weights(exmat_body* body, int64_t region, const double* weights,
                                                      int64_t count) EXMAT_NOEXCEPT;

/* Muscles: the weights of examples are chosen before each step so that points of the body come as near to their targets
   as they can. Of a body that steps in its modes; while it sleeps or is in all vertices its weights stay. */
typedef struct exmat_reach {
  size_t size;    /* sizeof(exmat_reach), set by the caller */
  int64_t region; /* whose examples; -1: of the whole body; -1 */
  double change;  /* most that a weight changes in a step, in (0, 1]; 0.05 */
  double horizon; /* > 0 [s]: the body is looked at where it would be after so long, at the end of one long step; of the
                     order of its slowest period, or it swings about its targets; 0.5 */
  const double* lowest;  /* [examples] limits of the weights in [0, 1], which let them add up to 1; NULL: 0 */
  const double* highest; /* likewise; NULL: 1 */
  int64_t examples;      /* K, the length of the two; 0 where both are NULL */
} exmat_reach;

/* Sets all members to their defaults; `size` is sizeof(exmat_reach). */
EXMAT_API exmat_status exmat_reach_default(exmat_reach* reach, size_t size) EXMAT_NOEXCEPT;

/* From the next step on: brings `points` to the world places `targets` [coordinates = 3k] [m], the sum of their squared
   distances being least, until it is called again. `reach` NULL: the defaults. `points` NULL, with 0 coordinates: the
   weights stay as they are from now on; exmat_body_set_example_weights() gives them back to the pose. Allocates. */
EXMAT_API exmat_status exmat_body_reach(exmat_body* body, const exmat_points* points, const double* targets,
                                        int64_t coordinates, const exmat_reach* reach) EXMAT_NOEXCEPT;

/* Displacement of the points at the end of the next step by a change of the weights, `sensitivity` [count = 3k K], a
   row of K for each coordinate: per weight that goes from the rest pose to example k [m], 0 for the rest pose itself.
   With the mass, damping and stiffness of a step; contacts are left out. */
EXMAT_API exmat_status exmat_body_read_sensitivity(const exmat_body* body, int64_t region, const exmat_points* points,
                                                   double* sensitivity, int64_t count) EXMAT_NOEXCEPT;

/* ---- contacts of one body ---------------------------------------------------------------------------------------- */

/* A vertex of the object that touched at the end of the last step. */
typedef struct exmat_contact {
  int64_t vertex;     /* 0-based */
  int64_t obstacle;   /* its id */
  double position[3]; /* of the vertex, world [m] */
  double normal[3];   /* unit, away from the obstacle */
  double force[3];    /* on the body [N] */
  double depth;       /* of the vertex in the obstacle; negative where damping alone acts [m] */
} exmat_contact;

/* Number of contacts; negative where `body` is NULL. And `contacts` [count] in order of vertex and obstacle; `size` is
   sizeof(exmat_contact). */
EXMAT_API int64_t exmat_body_contacts(const exmat_body* body) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_body_read_contacts(const exmat_body* body, exmat_contact* contacts, int64_t count,
                                                size_t size) EXMAT_NOEXCEPT;

/* Load of the contacts in the last call that stepped the body, as a constant force [3] [N] and torque [3] [N m] over
   its steps, world: on the obstacle `id`, about the origin of its frame; or, -1, on the body, about its centre of mass
   where it is free, else about the origin of the frame that it deforms in. Either may be NULL. */
EXMAT_API exmat_status exmat_body_read_contact_load(const exmat_body* body, int64_t id, double* force,
                                                    double* torque) EXMAT_NOEXCEPT;

/* ---- states ---------------------------------------------------------------------------------------------------- */

/* A state is all that a body carries from step to step, as numbers: steps, displacement and velocity now and one step
   earlier, motion, applied forces, targets, contacts. Bodies of the same bundle, settings or scene, with the same
   obstacles, take it and go on to the last bit, in this version of the library. */

/* Count of its numbers now: the same for all bodies of a model in one space, but for 10 for each contact. Negative
   where `body` is NULL. */
EXMAT_API int64_t exmat_body_state_size(const exmat_body* body) EXMAT_NOEXCEPT;

/* `numbers` [count = exmat_body_state_size()]. */
EXMAT_API exmat_status exmat_body_read_state(const exmat_body* body, double* numbers, int64_t count) EXMAT_NOEXCEPT;

/* `numbers` [count] that exmat_body_read_state() wrote. Numbers that are no state of this model are refused. */
EXMAT_API exmat_status exmat_body_set_state(exmat_body* body, const double* numbers, int64_t count) EXMAT_NOEXCEPT;

/* Hash over the bits of q and v of `count` bodies in order, of free ones of their motion, too: the state hash that
   exmat-runtime run prints. */
EXMAT_API exmat_status exmat_bodies_hash(exmat_body* const* bodies, int64_t count, uint64_t* hash) EXMAT_NOEXCEPT;

#ifdef __cplusplus
}
#endif

/* NOLINTEND(readability-identifier-naming) */

#include "exmat/drawing.h"
#include "exmat/world.h"

#endif
