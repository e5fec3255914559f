/*
 * Bodies that touch each other. A part of exmat.h, which includes it and says what all of it has in common.
 */
#ifndef EXMAT_WORLD_H
#define EXMAT_WORLD_H

#include "exmat/exmat.h"

/* NOLINTBEGIN(readability-identifier-naming): names of a C library */

#ifdef __cplusplus
extern "C" {
#endif

/* ---- worlds ---------------------------------------------------------------------------------------------------- */

/* Bodies that touch each other, stepped together: those of any models that know of contact (use_contact, or a scene
   with obstacles) and have the same time step. All functions of a body serve bodies of a world, too, but for those that
   step it. A world is for one thread at a time, and so are its bodies. */
typedef struct exmat_world exmat_world;

/* How bodies touch, all per area of their surfaces. */
typedef struct exmat_contact_law {
  size_t size;      /* sizeof(exmat_contact_law) where the caller was compiled */
  double stiffness; /* pressure per depth, > 0 [N/m^3]; 1e6 */
  double damping;   /* pressure per approach velocity, >= 0 [N s/m^3]; 0 */
  double friction;  /* Coulomb's coefficient, >= 0; 0 */
  int32_t self;     /* 1: a body also touches itself; 0. Takes time for each body's model when it is added */
  int32_t reserved; /* 0 */
} exmat_contact_law;

/* Sets all members to their defaults; `size` is sizeof(exmat_contact_law). */
EXMAT_API exmat_status exmat_contact_law_default(exmat_contact_law* law, size_t size) EXMAT_NOEXCEPT;

/* Without bodies; `law` NULL: the defaults. */
EXMAT_API exmat_status exmat_world_create(const exmat_contact_law* law, exmat_world** world) EXMAT_NOEXCEPT;

/* Of a scene file with "bodies": all of them, where they start. Ids are 0, 1, ... in its order. */
EXMAT_API exmat_status exmat_world_create_from_scene(const char* scene_path, exmat_world** world) EXMAT_NOEXCEPT;

/* The same of the text of a scene file; `path` names it in messages, and names in it are relative to that path's
   folder. */
EXMAT_API exmat_status exmat_world_create_from_text(const char* scene, const char* path,
                                                    exmat_world** world) EXMAT_NOEXCEPT;

/* With the bodies that are in it. */
EXMAT_API void exmat_world_destroy(exmat_world* world) EXMAT_NOEXCEPT;

/* Changes stiffness, damping and friction; whether bodies touch themselves stays. */
EXMAT_API exmat_status exmat_world_set_contact_law(exmat_world* world, const exmat_contact_law* law) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_contact_law(const exmat_world* world, exmat_contact_law* law) EXMAT_NOEXCEPT;

/* The world's from now on, as it is and where it is. `id` >= 0 is a number that no later body of the world gets. What
   it overlaps pushes it out. Reads the surface of a model's first body. exmat_body_destroy() takes a body out, too. */
EXMAT_API exmat_status exmat_world_add_body(exmat_world* world, exmat_body* body, int64_t* id) EXMAT_NOEXCEPT;

/* Takes a body out and gives it back: `body` is the caller's again. */
EXMAT_API exmat_status exmat_world_remove_body(exmat_world* world, int64_t id, exmat_body** body) EXMAT_NOEXCEPT;

/* How many there are; negative where `world` is NULL. And `ids` [count] of all, in ascending order. */
EXMAT_API int64_t exmat_world_bodies(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_body_ids(const exmat_world* world, int64_t* ids, int64_t count) EXMAT_NOEXCEPT;

/* A body, which stays the world's; NULL where there is none. And its name in the scene, with its number where there are
   several: "teddy_12"; "" of a body that was added. */
EXMAT_API exmat_body* exmat_world_body(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;
EXMAT_API const char* exmat_world_body_name(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;
/* Of a body of a scene its place among the scene's "bodies", 0-based: those of one place have one model. Negative of a
   body that was added, and where there is none. */
EXMAT_API int64_t exmat_world_body_kind(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;

/* What the steps of one call did. */
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
} exmat_world_report;

/* Takes `steps` >= 0 steps of all bodies, by up to `threads` threads as in exmat_bodies_step(); the results do not
   depend on their number. EXMAT_NON_FINITE names the first such body: it, and what touches it, are as they were before
   that step, which the others have taken. `report` may be NULL. Allocates where more touches than ever before. */
EXMAT_API exmat_status exmat_world_step(exmat_world* world, int64_t steps, int32_t threads,
                                        exmat_world_report* report) EXMAT_NOEXCEPT;

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

/* How many; negative where `world` is NULL. And `contacts` [count]; `size` is sizeof(exmat_body_contact). */
EXMAT_API int64_t exmat_world_contacts(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_contacts(const exmat_world* world, exmat_body_contact* contacts, int64_t count,
                                                 size_t size) EXMAT_NOEXCEPT;

/* Of all bodies. */
EXMAT_API exmat_status exmat_world_read_energies(const exmat_world* world, exmat_energies* energies) EXMAT_NOEXCEPT;

/* Hash over the bits of all bodies in the order of their ids, as exmat_bodies_hash(). */
EXMAT_API exmat_status exmat_world_hash(const exmat_world* world, uint64_t* hash) EXMAT_NOEXCEPT;

/* The states of all bodies in the order of their ids, and what their contacts remember, as the states of bodies
   above. A world of as many such bodies takes them and goes on to the last bit. */
EXMAT_API int64_t exmat_world_state_size(const exmat_world* world) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_state(const exmat_world* world, double* numbers, int64_t count) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_set_state(exmat_world* world, const double* numbers, int64_t count) EXMAT_NOEXCEPT;

#ifdef __cplusplus
}
#endif

/* NOLINTEND(readability-identifier-naming) */

#endif
