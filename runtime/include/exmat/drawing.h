/*
 * What programs need to draw bodies by themselves, and to look inside: surfaces and points on them, cubature elements,
 * energies, targets, times, elasticity, load capacity. A part of exmat.h, which includes it and says what all of it has
 * in common.
 */
#ifndef EXMAT_DRAWING_H
#define EXMAT_DRAWING_H

#include "exmat/exmat.h"

/* NOLINTBEGIN(readability-identifier-naming): names of a C library */

#ifdef __cplusplus
extern "C" {
#endif

/* ---- what to draw ---------------------------------------------------------------------------------------------- */

/* Contents of a bundle, before a model is made of it. */
typedef struct exmat_bundle_info {
  size_t size;                       /* sizeof(exmat_bundle_info), set by the caller */
  int64_t modes, vertices, elements; /* r, n, cubature elements */
  int64_t examples, regions;         /* K of the whole body, the rest pose among them, or 0; number of regions */
  int64_t render_vertices;           /* of the render mesh; 0 where there is none */
  int32_t constrained, contact;      /* 1: it has fixed vertices; its bodies can touch */
  int32_t polynomial, targets;       /* 1: it has the exact polynomial; a table of targets of the whole body */
} exmat_bundle_info;
EXMAT_API exmat_status exmat_bundle_read_info(const char* bundle_path, exmat_bundle_info* info) EXMAT_NOEXCEPT;

/* The name of its region 0 <= region < exmat_bundle_info.regions, with a terminating 0, into `name` [bytes]. */
EXMAT_API exmat_status exmat_bundle_read_region_name(const char* bundle_path, int64_t region, char* name,
                                                     int64_t bytes) EXMAT_NOEXCEPT;

/* Triangles that are drawn, and their points. A point is at placement (X + U q): X and U are read once, q and the
   placement before each frame; what draws may do the sum itself, on a GPU. */
typedef struct exmat_surface exmat_surface;

/* Creates the surface of the tets' boundary, of the render mesh, or (auto) of the render mesh if the bundle has one. */
enum { EXMAT_SURFACE_AUTO = 0, EXMAT_SURFACE_OBJECT = 1, EXMAT_SURFACE_RENDER = 2 };
EXMAT_API exmat_status exmat_surface_create(const exmat_model* model, int32_t kind,
                                            exmat_surface** surface) EXMAT_NOEXCEPT;
EXMAT_API void exmat_surface_destroy(exmat_surface* surface) EXMAT_NOEXCEPT;

/* EXMAT_SURFACE_OBJECT or EXMAT_SURFACE_RENDER; negative where `surface` is NULL. */
EXMAT_API int32_t exmat_surface_kind(const exmat_surface* surface) EXMAT_NOEXCEPT;
/* f; negative where `surface` is NULL. And three of its points of each, outward, into `triangles` [count = 3f]. */
EXMAT_API int64_t exmat_surface_triangles(const exmat_surface* surface) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_surface_read_triangles(const exmat_surface* surface, int32_t* triangles,
                                                    int64_t count) EXMAT_NOEXCEPT;
/* Its points, to be read and pushed; they belong to the surface and are not destroyed. NULL where `surface` is NULL. */
EXMAT_API const exmat_points* exmat_surface_points(const exmat_surface* surface) EXMAT_NOEXCEPT;
/* Which vertex of the object each of the k points is, of the object's boundary; of a render mesh the vertex of the
   boundary that is nearest to it at rest. `vertices` [count = k]. */
EXMAT_API exmat_status exmat_surface_read_vertices(const exmat_surface* surface, int64_t* vertices,
                                                   int64_t count) EXMAT_NOEXCEPT;

/* Unit `normals` [coordinates = 3k] of its points at the positions `xyz` [3k], in whichever frame these are: the sum of
   the vector areas about each. Points at one place, as along the seams of a texture, have the same unless their own
   differ by more than 60 degrees at rest. Allocates nothing; reads no file. */
EXMAT_API exmat_status exmat_surface_read_normals(const exmat_surface* surface, const float* xyz, float* normals,
                                                  int64_t coordinates) EXMAT_NOEXCEPT;

/* k points on triangles of a surface, one on each of `triangles` [count = k], k >= 1, at the corners' `shares`
   [3 count], which add up to 1. Reads no file. */
EXMAT_API exmat_status exmat_points_create_on_surface(const exmat_surface* surface, const int64_t* triangles,
                                                      const double* shares, int64_t count,
                                                      exmat_points** points) EXMAT_NOEXCEPT;

/* The first triangle of the surface of a body, as it is now, that a ray from `origin` [3] [m] along `direction` [3], of
   any length but 0, meets within `most` [m], from either side: its number, -1 where there is none; the `shares` [3] of
   its corners, as exmat_points_create_on_surface() takes them; the `distance` from the origin [m]; and the unit
   `normal` [3], outward. All but `triangle` may be NULL. It takes the time of exmat_body_read_positions_double(), r
   operations where the ray misses the box about all that the modes of the body reach, and allocates. */
EXMAT_API exmat_status exmat_body_cast_ray(const exmat_body* body, const exmat_surface* surface, const double* origin,
                                           const double* direction, double most, int64_t* triangle, double* shares,
                                           double* distance, double* normal) EXMAT_NOEXCEPT;

/* The place that a ray through a world meets: of a surface of a body, or of an obstacle. */
typedef struct exmat_ray_hit {
  size_t size;      /* sizeof(exmat_ray_hit), set by the caller */
  int64_t body;     /* its id in the world; -1 of an obstacle, and where the ray meets nothing */
  int64_t surface;  /* of a body: the number of its surface among those that were given; else -1 */
  int64_t triangle; /* of that surface; -1 of an obstacle */
  double shares[3]; /* of the triangle's corners, sum 1, as exmat_points_create_on_surface() takes them */
  double distance;  /* from the origin of the ray [m] */
  double normal[3]; /* unit, outward */
  int64_t
      obstacle; /* its id in the world; -1 of a body. -1 as `body` is: the ray meets nothing, nothing else is told */
} exmat_ray_hit;

/* The first triangle of all bodies of the world, as they are now, that a ray meets, as exmat_body_cast_ray(), or the
   obstacle that it enters before. Bodies have those of `surfaces` [count] that are of their model, and others are not
   seen; with no surface obstacles alone are. Obstacles are solid, meshes with a thickness by that much: one that the
   ray begins in is not seen. A body in its modes takes r operations where the ray misses the box about all that its
   modes reach, or something is nearer. Allocates. */
EXMAT_API exmat_status exmat_world_cast_ray(const exmat_world* world, const exmat_surface* const* surfaces,
                                            int64_t count, const double* origin, const double* direction, double most,
                                            exmat_ray_hit* hit) EXMAT_NOEXCEPT;

/* The places of the s cubature elements, of tets their centroids and of rings their vertices, and how many each stands
   for: `weights` [count = s], or NULL. */
EXMAT_API int64_t exmat_model_elements(const exmat_model* model) EXMAT_NOEXCEPT; /* s */
EXMAT_API exmat_status exmat_model_read_element_weights(const exmat_model* model, double* weights,
                                                        int64_t count) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_points_create_elements(const exmat_model* model, exmat_points** points) EXMAT_NOEXCEPT;

/* X `rest` [coordinates = 3k] [m], and U `rows` [count = 3k r] [kg^-1/2]; not of
   exmat_points_create_all_vertices(). */
EXMAT_API exmat_status exmat_points_read_rest(const exmat_points* points, double* rest,
                                              int64_t coordinates) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_points_read_basis(const exmat_points* points, float* rows, int64_t count) EXMAT_NOEXCEPT;

/* The triangles of an obstacle of a world that is made of arrays, EXMAT_MESH or EXMAT_HEIGHT_FIELD: f, 0 of other
   shapes, negative where `world` is NULL or has no such obstacle. And the three corners of each into `corners`
   [coordinates = 9f] [m], outward, in the obstacle's frame, which its motion moves. Of a
   shell they are its middle. */
EXMAT_API int64_t exmat_world_obstacle_triangles(const exmat_world* world, int64_t id) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_obstacle_triangles(const exmat_world* world, int64_t id, double* corners,
                                                           int64_t coordinates) EXMAT_NOEXCEPT;

/* `placement` [12]: three rows of four numbers, the rotation R and the shift t of x = R (X + U q) + t. */
EXMAT_API exmat_status exmat_body_read_placement(const exmat_body* body, double* placement) EXMAT_NOEXCEPT;

/* Elastic energy per volume at rest [J/m^3] at the points of the surface [count = k]: of the tet of a point, of a
   vertex the mean of its tets by volume. */
EXMAT_API exmat_status exmat_body_read_energy_density(const exmat_body* body, exmat_surface* surface, float* density,
                                                      int64_t count) EXMAT_NOEXCEPT;

/* Name of an example of the whole body (region -1) or of a region, NULL where there is none such; its pose as reduced
   coordinates `q` [modes = r]. */
EXMAT_API const char* exmat_model_example_name(const exmat_model* model, int64_t region,
                                               int64_t example) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_model_read_example_pose(const exmat_model* model, int64_t region, int64_t example,
                                                     double* q, int64_t modes) EXMAT_NOEXCEPT;
/* The target of the last step as far as the modes see it: the reduced coordinates `q` [modes = r] that the linear
   example force draws to. 0 before the first step, where no example force acts, and of an elastic force by a table. */
EXMAT_API exmat_status exmat_body_read_target(const exmat_body* body, int64_t region, double* q,
                                              int64_t modes) EXMAT_NOEXCEPT;

/* Times of the stages of the last call that stepped a profiled world, summed over its steps [s]. The
   first five are the stages of bodies that touch no other, as the threads' clocks add up; the rest are those of the
   world, on the wall clock. */
typedef struct exmat_profile {
  size_t size; /* sizeof(exmat_profile), set by the caller */
  double weights, target, internal_force, solve, contact;
  double broad_phase, candidates, single_bodies, islands;
} exmat_profile;
EXMAT_API exmat_status exmat_world_set_profiled(exmat_world* world, int32_t profiled) EXMAT_NOEXCEPT;
EXMAT_API exmat_status exmat_world_read_profile(const exmat_world* world, exmat_profile* profile) EXMAT_NOEXCEPT;

/* ---- elasticity ------------------------------------------------------------------------------------------------ */

/* At reduced coordinates `q` [modes = r]: the elastic `energy` [J] that steps take, by the polynomial or by cubature,
   its derivative `force` [r], and its Hessian `tangent` [r x r], symmetric and as it is, indefinite or not. A result
   may be NULL. */
EXMAT_API exmat_status exmat_model_read_elasticity(const exmat_model* model, const double* q, int64_t modes,
                                                   double* energy, double* force, double* tangent) EXMAT_NOEXCEPT;

/* A sparse matrix of the object with all its degrees of freedom, 3n x 3n, x y z of one vertex after another, the fixed
   ones among them. Both triangles are stored. */
typedef struct exmat_matrix exmat_matrix;

/* The consistent mass M [kg], and the stiffness K [N/m], the Hessian of the elastic energy at rest. */
enum { EXMAT_MASS = 0, EXMAT_STIFFNESS = 1 };
EXMAT_API exmat_status exmat_matrix_create(const exmat_model* model, int32_t kind,
                                           exmat_matrix** matrix) EXMAT_NOEXCEPT;
EXMAT_API void exmat_matrix_destroy(exmat_matrix* matrix) EXMAT_NOEXCEPT;
EXMAT_API int64_t exmat_matrix_entries(const exmat_matrix* matrix) EXMAT_NOEXCEPT; /* negative where it is NULL */
/* By compressed rows: row i has the `columns`, ascending, and `values` [entries] from starts[i] to starts[i + 1],
   `starts` [3n + 1]. */
EXMAT_API exmat_status exmat_matrix_read(const exmat_matrix* matrix, int64_t* starts, int64_t* columns, double* values,
                                         int64_t entries) EXMAT_NOEXCEPT;

/* ---- load capacity ---------------------------------------------------------------------------------------------- */

/* The share of a force's work that the modes of a model lose, beside the same mesh with
   all degrees of freedom, both about the rest shape, in a time of the body's slowest vibration (docs/method.md). Made
   of what the bundle holds of the object; factorises a matrix of all degrees of freedom: seconds from some ten thousand
   vertices on. Immutable: any number of threads may use it. */
typedef struct exmat_capacity exmat_capacity;

/* `spread` >= 0 [m]: a force acts on the surface within that distance of its point, at the nearest vertex where there
   is none. A force on a single point is lost the more, the finer the mesh is. */
EXMAT_API exmat_status exmat_capacity_create(const exmat_model* model, double spread,
                                             exmat_capacity** capacity) EXMAT_NOEXCEPT;
EXMAT_API void exmat_capacity_destroy(exmat_capacity* capacity) EXMAT_NOEXCEPT;

/* The time that work is compared in [s]; negative where `capacity` is NULL. */
EXMAT_API double exmat_capacity_time_scale(const exmat_capacity* capacity) EXMAT_NOEXCEPT;

/* `lost` in [0, 1]: of `forces` [coordinates = 3k] [N], world, on points of the same model. 0 where there is no force.
 */
EXMAT_API exmat_status exmat_capacity_read_lost(const exmat_capacity* capacity, const exmat_body* body,
                                                const exmat_points* points, const double* forces, int64_t coordinates,
                                                double* lost) EXMAT_NOEXCEPT;

/* The same of the contact forces at the end of the body's last step, which are not spread: those on its vertices, by
   obstacles and by other bodies of its world. */
EXMAT_API exmat_status exmat_capacity_read_contact_lost(const exmat_capacity* capacity, const exmat_body* body,
                                                        double* lost) EXMAT_NOEXCEPT;

/* From now on reports of the body hold its lost work: a solution with all degrees of freedom at the end of each call
   that steps it, which allocates. Of applied forces those that are applied from now on count. `capacity` is of the same
   model and may be destroyed while the body has it; NULL: no longer. */
EXMAT_API exmat_status exmat_body_set_capacity(exmat_body* body, const exmat_capacity* capacity) EXMAT_NOEXCEPT;

#ifdef __cplusplus
}
#endif

/* NOLINTEND(readability-identifier-naming) */

#endif
