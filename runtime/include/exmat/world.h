/*
 * Worlds: bodies that are stepped together, and the obstacles that they touch. A part of exmat.h, which includes it and
 * says what all of it has in common.
 */
#ifndef EXMAT_WORLD_H
#define EXMAT_WORLD_H

#include "exmat/exmat.h"

/* NOLINTBEGIN(readability-identifier-naming): names of a C library */

#ifdef __cplusplus
extern "C" {
#endif

/* ---- worlds ---------------------------------------------------------------------------------------------------- */

/* Law of the contact between bodies, all per area of their surfaces. */
typedef struct exmat_contact_law {
  size_t size;      /* sizeof(exmat_contact_law) where the caller was compiled */
  double stiffness; /* pressure per depth, > 0, at most 1e15 [N/m^3]; 1e6 */
  double damping;   /* pressure per approach velocity, >= 0 [N s/m^3]; 0 */
  double friction;  /* Coulomb's coefficient, >= 0; 0 */
  int32_t self;     /* 1: a body also touches itself; 0. Takes time for each body's model when it is added */
  int32_t apart;    /* 1: bodies touch neither each other nor themselves, obstacles alone; 0 */
  double release;   /* how fast what overlaps at the start is let out, obstacles included, > 0 [m/s]; 1 */
} exmat_contact_law;

/* Sets all members to their defaults; `size` is sizeof(exmat_contact_law). */
EXMAT_API exmat_status exmat_contact_law_default(exmat_contact_law* law, size_t size) EXMAT_NOEXCEPT;

/* Without bodies; `law` NULL: the defaults. */
EXMAT_API exmat_status exmat_world_create(const exmat_contact_law* law, exmat_world** world) EXMAT_NOEXCEPT;

/* Loads a scene file: all its bodies, where they start, and its obstacles. Ids of either are 0, 1, ... in its order.
   The `instances` of a scene with a single "bundle" are apart. */
EXMAT_API exmat_status exmat_world_create_from_scene(const char* scene_path, exmat_world** world) EXMAT_NOEXCEPT;

/* The same of the text of a scene file; `path` names it in messages, and names in it are relative to that path's
   folder. `use_contact` 1: its bodies can touch obstacles also where the scene has none. */
EXMAT_API exmat_status exmat_world_create_from_text(const char* scene, const char* path, int32_t use_contact,
                                                    exmat_world** world) EXMAT_NOEXCEPT;

/* With the bodies that are in it; nothing where it is a body's own. */
EXMAT_API void exmat_world_destroy(exmat_world* world) EXMAT_NOEXCEPT;

/* The world that a body is in; one of its own is there as long as the body and not in another. NULL where `body` is
   NULL. */
EXMAT_API exmat_world* exmat_body_world(const exmat_body* body) EXMAT_NOEXCEPT;

/* All bodies back to rest at time 0, without applied forces. Obstacles that no host has moved begin anew, too. */
EXMAT_API exmat_status exmat_world_reset(exmat_world* world) EXMAT_NOEXCEPT;

/* Its steps times the time step [s]; negative where `world` is NULL. */
EXMAT_API double exmat_world_time(const exmat_world* world) EXMAT_NOEXCEPT;

/* Changes stiffness, damping, friction and release, the latter between bodies and of obstacles added later; `self` and
   `apart` stay. */
EXMAT_API exmat_status exmat_world_set_contact_law(exmat_world* world, const exmat_contact_law* law) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_contact_law(const exmat_world* world, exmat_contact_law* law) EXMAT_NOEXCEPT;

/* Most bodies of space EXMAT_SPACE_AUTO that step in all vertices at once, >= 0; at first any number. Those that the
   host pushes hardest come first, then those that something acted on last. */
EXMAT_API exmat_status exmat_world_set_full_bodies(exmat_world* world, int32_t most) EXMAT_NOEXCEPT;

/* The world's from now on, as it is and where it is, at the time of the world, which is the first body's. `id` >= 0 is
   a number that no later body of the world gets. What it overlaps pushes it out; obstacles of the world that it had of
   its own stay behind. Unless bodies are apart, its model has to know of contact, and the surface of a model's first
   body is read. exmat_body_destroy() takes a body out, too. */
EXMAT_API exmat_status exmat_world_add_body(exmat_world* world, exmat_body* body, int64_t* id) EXMAT_NOEXCEPT;

/* Takes a body out and gives it back: `body` is the caller's again, in a world of its own. */
EXMAT_API exmat_status exmat_world_remove_body(exmat_world* world, int64_t id, exmat_body** body) EXMAT_NOEXCEPT;

/* Number of bodies; negative where `world` is NULL. And `ids` [count] of all, in ascending order. */
EXMAT_API int64_t exmat_world_bodies(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_body_ids(const exmat_world* world, int64_t* ids, int64_t count) EXMAT_NOEXCEPT;

/* A body, which stays the world's; NULL where there is none. And its name in the scene, with its number where there are
   several: "teddy_12"; "" of a body that was added. */
EXMAT_API exmat_body* exmat_world_body(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;
EXMAT_API const char* exmat_world_body_name(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;
/* The place of a scene's body among the scene's "bodies", 0-based: those of one place have one model. Negative of a
   body that was added, and where there is none. */
EXMAT_API int64_t exmat_world_body_kind(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;

/* Who touches whom: two bodies, or a body and an obstacle, if each one's mask has a bit of the other's group. 1 and all
   bits of a body that was created, those of its scene where that says. */
EXMAT_API exmat_status exmat_body_set_group(exmat_body* body, uint32_t group, uint32_t mask) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_body_read_group(const exmat_body* body, uint32_t* group, uint32_t* mask) EXMAT_NOEXCEPT;

/* Results of the steps of one call. */
typedef struct exmat_world_report {
  size_t size;                 /* sizeof(exmat_world_report), set by the caller */
  int64_t steps;               /* taken; fewer than asked for only with EXMAT_NON_FINITE */
  int64_t newton_iterations;   /* of the island of most, summed over the steps */
  int64_t unconverged_islands; /* bodies that touch and were not solved to the tolerance, in all steps */
  int64_t pairs;               /* of bodies whose bounds overlapped in the last step */
  int64_t touching_pairs;      /* of those, with vertices that could touch in the last step */
  int64_t islands;             /* bodies that touch and were solved together in the last step */
  int64_t largest_island;      /* most bodies of an island in any step */
  double seconds;              /* wall clock */
  int64_t asleep;              /* bodies that slept through the last step */
  int64_t divided_islands;     /* bodies that touch and took several smaller steps, in all steps */
} exmat_world_report;

/* Takes `steps` >= 0 steps of all bodies, by up to `threads` threads (0: as many as there are processors), and never
   more than there are bodies and processors, or than the system lets start; the results do not depend on their number.
   Those of bodies that go side by side are those of exmat_body_step() to rounding, as sums are taken in another order.
   EXMAT_NON_FINITE names the first such body: it, and what touches it, are as they were before
   that step, which the others have taken. `report` may be NULL. Allocates where more touches than ever before,
   and where a step is divided. */
EXMAT_API exmat_status exmat_world_step(exmat_world* world, int64_t steps, int32_t threads,
                                        exmat_world_report* report) EXMAT_NOEXCEPT;

/* Runs tasks on a host's threads: calls task(data, i) once for each i < count, at the same time where it can, and
   returns when all have returned. They may be called by any thread, and do not wait for each other; the caller does the
   work of those that were not called. */
typedef void (*exmat_run_tasks)(void* user, void (*task)(void* data, int32_t i), void* data, int32_t count);
/* Shares steps of all worlds of this process among the threads of `run` from then on; NULL: among the library's own.
   Not while a world steps. A call of `run` gets at most `threads` tasks. */
EXMAT_API void exmat_set_scheduler(exmat_run_tasks run, void* user) EXMAT_NOEXCEPT;

/* A vertex of one body that touched the surface of another, or of its own, at the end of the last step.
   exmat_body_read_contacts() has those with obstacles, exmat_body_read_contact_load() the load of both on a body. */
typedef struct exmat_body_contact {
  int64_t body; /* ids */
  int64_t other;
  int64_t vertex;     /* of the body's object, 0-based */
  double position[3]; /* of the vertex, world [m] */
  double normal[3];   /* unit, away from the other */
  double force[3];    /* on the body [N]; the other has its negative */
  double depth;       /* of the vertex in the other; negative where damping alone acts [m] */
} exmat_body_contact;

/* Number of contacts; negative where `world` is NULL. And `contacts` [count]; `size` is sizeof(exmat_body_contact). */
EXMAT_API int64_t exmat_world_contacts(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_contacts(const exmat_world* world, exmat_body_contact* contacts, int64_t count,
                                                 size_t size) EXMAT_NOEXCEPT;

/* Two that touched before the last call that stepped the world, or after it. A body that fell asleep goes on touching;
   one that was put elsewhere, added or taken out since the call before has no touch that ends. */
enum { EXMAT_TOUCH_BEGINS = 0, EXMAT_TOUCH_STAYS = 1, EXMAT_TOUCH_ENDS = 2 };
typedef struct exmat_touch {
  int64_t body;     /* ids */
  int64_t other;    /* > body, or body where it touches itself; -1 of an obstacle */
  int64_t obstacle; /* -1 of another body */
  int32_t change;   /* EXMAT_TOUCH_BEGINS: after the call, not before it */
  int32_t reserved; /* 0 */
} exmat_touch;

/* Number of touches; negative where `world` is NULL. And `touches` [count], in the order of their ids, obstacles last;
   `size` is sizeof(exmat_touch). */
EXMAT_API int64_t exmat_world_touches(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_touches(const exmat_world* world, exmat_touch* touches, int64_t count,
                                                size_t size) EXMAT_NOEXCEPT;

/* Reads the energies of all bodies together. */
EXMAT_API exmat_status exmat_world_read_energies(const exmat_world* world, exmat_energies* energies) EXMAT_NOEXCEPT;

/* Hash over the bits of all bodies in the order of their ids, as exmat_bodies_hash(). */
EXMAT_API exmat_status exmat_world_hash(const exmat_world* world, uint64_t* hash) EXMAT_NOEXCEPT;

/* The states of all bodies in the order of their ids, and what their contacts remember, as the states of bodies
   above. A world of as many such bodies takes them and goes on to the last bit. */
EXMAT_API int64_t exmat_world_state_size(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_state(const exmat_world* world, double* numbers, int64_t count) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_set_state(exmat_world* world, const double* numbers, int64_t count) EXMAT_NOEXCEPT;

/* A snapshot is for rollback: bytes in the caller's memory, saved and restored quickly, of all that steps and the host
   change in a world: states, contacts, sleep, spaces, attachments, forces, given weights and other settings of bodies,
   the contact law, obstacles that were moved or whose law was changed. A restored world goes on to the last bit. */

/* Bytes of a snapshot taken now; 0 where `world` is NULL. They grow with the bodies and obstacles of the world, and
   from step to step with contacts (80 a vertex), attachments, forces with an id, and bodies that go to all vertices. */
EXMAT_API size_t exmat_world_snapshot_size(const exmat_world* world) EXMAT_NOEXCEPT;

/* Saves a snapshot into `buffer` [size >= exmat_world_snapshot_size()], aligned to 8 bytes. Never allocates. A smaller
 * one is refused, and is no snapshot then. */
EXMAT_API exmat_status exmat_world_save(const exmat_world* world, void* buffer, size_t size) EXMAT_NOEXCEPT;

/* Goes back to a snapshot, or on to it, from `buffer` [size: not less than what was saved], aligned to 8 bytes. The
   world has to have the bodies and obstacles, of the same ids and groups, that it had; so has another world, also of
   another process, with the same version of the library and bodies of the same bundles and settings. Anything else is
   refused. Reports and lists of contacts are empty until the next step. Allocates only where the world has to hold what
   it does not now: attachments or forces with an id that were added or removed since, bodies in all vertices, more
   contacts between bodies. */
EXMAT_API exmat_status exmat_world_restore(exmat_world* world, const void* buffer, size_t size) EXMAT_NOEXCEPT;

/* ---- obstacles ------------------------------------------------------------------------------------------------- */

/* Obstacles are a world's: those of its scene, and those that its host adds, moves and removes between steps. All its
   bodies touch them whose models know of contact (use_contact, or a scene with obstacles) and whose group and mask
   allow it. An obstacle has a number, `id` >= 0, that no later one of the world gets. exmat_body_reset() and states
   keep the host's where they are. */

/* Shapes. The last two are made of arrays: exmat_world_add_shape(). */
enum { EXMAT_PLANE = 0, EXMAT_SPHERE = 1, EXMAT_BOX = 2, EXMAT_CAPSULE = 3, EXMAT_MESH = 4, EXMAT_HEIGHT_FIELD = 5 };

/* Its shape, in its own frame, which is the world until the obstacle is moved, and its law: pressures on the body's
   surface. Members that the shape does not name are not looked at. No length is above 1e30 m. */
typedef struct exmat_obstacle {
  size_t size;     /* sizeof(exmat_obstacle) where the caller was compiled */
  double point[3]; /* of the plane; centre of sphere and box; where the capsule's axis begins; origin of the axes of a
                      shape made of arrays [m]; 0 */
  double
      direction[3]; /* the plane's, away from the solid; from the beginning to the end of the capsule's axis [m]; z */
  double half_extents[3]; /* of the box, > 0 [m]; 1 */
  double orientation[4];  /* of the box, or of those axes, a quaternion, w first; 1 0 0 0 */
  double radius;          /* of sphere and capsule, > 0 [m]; 1 */
  double stiffness;       /* pressure per depth, > 0, at most 1e15 [N/m^3]; 1e6 */
  double damping;         /* pressure per approach velocity, >= 0 [N s/m^3]; 0 */
  double friction;        /* Coulomb's coefficient, >= 0; 0 */
  int32_t shape;          /* EXMAT_PLANE */
  uint32_t group;         /* bits that it has; 1 */
  uint32_t mask;          /* bits of the groups of bodies that touch it; all: two touch if each mask has a bit of the
                             other's group */
  uint32_t reserved;      /* 0 */
} exmat_obstacle;

/* Sets all members to their defaults; `size` is sizeof(exmat_obstacle). */
EXMAT_API exmat_status exmat_obstacle_default(exmat_obstacle* obstacle, size_t size) EXMAT_NOEXCEPT;

EXMAT_API exmat_status exmat_world_add_obstacle(exmat_world* world, const exmat_obstacle* obstacle,
                                                int64_t* id) EXMAT_NOEXCEPT;
/* Meshes and height fields are made of arrays once, which are copied, and any number of obstacles of any worlds share
   them: a level has one. Immutable; may be destroyed while obstacles are made of it. */
typedef struct exmat_shape exmat_shape;

/* `vertices` [coordinates = 3k] [m] and `triangles` [corners = 3f], 0-based. Vertices at one place are one. With
   thickness 0 it is solid: each edge belongs to two triangles, and they look away from the solid; what is open or
   turned is refused in words. With a thickness > 0 [m] it is a shell about the triangles, on both sides, and may be
   open. */
EXMAT_API exmat_status exmat_shape_create_mesh(const double* vertices, int64_t coordinates, const int32_t* triangles,
                                               int64_t corners, double thickness, exmat_shape** shape) EXMAT_NOEXCEPT;

/* Ground: `heights` [rows x columns] along z [m], row by row, 2 or more of each; `spacing` [2]: of columns along x and
   of rows along y, > 0 [m]. Solid below, nothing beyond the border. */
EXMAT_API exmat_status exmat_shape_create_height_field(const double* heights, int64_t rows, int64_t columns,
                                                       const double* spacing, exmat_shape** shape) EXMAT_NOEXCEPT;

EXMAT_API void exmat_shape_destroy(exmat_shape* shape) EXMAT_NOEXCEPT;

/* As exmat_world_add_obstacle(), of that shape: of `obstacle` its law, point and orientation. Moved, read, changed and
   removed as others are. */
EXMAT_API exmat_status exmat_world_add_shape(exmat_world* world, const exmat_shape* shape,
                                             const exmat_obstacle* obstacle, int64_t* id) EXMAT_NOEXCEPT;

/* Removes an obstacle, and what it held by friction is let go. */
EXMAT_API exmat_status exmat_world_remove_obstacle(exmat_world* world, int64_t id) EXMAT_NOEXCEPT;

/* Number of obstacles; negative where `world` is NULL. And `ids` [count] of all, in ascending order. */
EXMAT_API int64_t exmat_world_obstacles(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_obstacle_ids(const exmat_world* world, int64_t* ids,
                                                     int64_t count) EXMAT_NOEXCEPT;

/* Sets where the obstacle's frame is now and how it moves on from here, straight and about a fixed axis, until it is
   moved again: to be called before each step, or each few, with the pose and the velocities of the host's rigid body.
   What touches is carried along by the velocities and not by a jump of the pose. */
EXMAT_API exmat_status exmat_world_move_obstacle(exmat_world* world, int64_t id,
                                                 const exmat_motion* motion) EXMAT_NOEXCEPT;

/* Either may be NULL. `motion` is that at the world's time. */
EXMAT_API exmat_status exmat_world_read_obstacle(const exmat_world* world, int64_t id, exmat_obstacle* obstacle,
                                                 exmat_motion* motion) EXMAT_NOEXCEPT;

/* Changes the law alone: stiffness > 0, damping >= 0, friction >= 0, as in exmat_obstacle. */
EXMAT_API exmat_status exmat_world_set_obstacle_law(exmat_world* world, int64_t id, double stiffness, double damping,
                                                    double friction) EXMAT_NOEXCEPT;

/* Load of all bodies' contacts on an obstacle in the last call that stepped the world, as a constant
   force [3] [N] and torque [3] [N m] about the origin of its frame, world. Either may be NULL. */
EXMAT_API exmat_status exmat_world_read_obstacle_load(const exmat_world* world, int64_t id, double* force,
                                                      double* torque) EXMAT_NOEXCEPT;

#ifdef __cplusplus
}
#endif

/* NOLINTEND(readability-identifier-naming) */

#endif
