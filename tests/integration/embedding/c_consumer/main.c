/* consumer SCENE BUNDLE STEPS ID FX FY FZ: steps the scene, then its bundle with a force on vertex ID instead of the
   scene's forces. Prints one line each: q in hexadecimal, then the position of the vertex. Compiled as C99. */
#include <exmat/exmat.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

static void check(exmat_status status) {
  if (status == EXMAT_OK) return;
  fprintf(stderr, "%s\n", exmat_last_error());
  exit((int)status);
}

static void print_body(exmat_body* body, const exmat_points* points, int64_t modes) {
  double* q = malloc((size_t)modes * sizeof *q);
  float xyz[3];
  int64_t i;
  if (q == NULL) exit(1);
  check(exmat_body_read_reduced(body, q, NULL, modes));
  check(exmat_body_read_positions(body, points, xyz, 3));
  for (i = 0; i < modes; ++i) printf("%a ", q[i]);
  printf("%a %a %a\n", xyz[0], xyz[1], xyz[2]);
  free(q);
}

static void run(const exmat_model* model, int64_t steps, int64_t vertex, const double* force) {
  exmat_points* points = NULL;
  exmat_body* body = NULL;
  exmat_report report;
  check(exmat_points_create_vertices(model, &vertex, 1, &points));
  check(exmat_body_create(model, &body));
  if (force != NULL) check(exmat_body_apply_forces(body, points, force, 3));
  report.size = sizeof report;
  check(exmat_body_step(body, steps, &report));
  if (report.steps != steps || report.newton_iterations < steps || report.seconds <= 0) exit(1);
  print_body(body, points, exmat_model_modes(model));
  exmat_points_destroy(points);
  exmat_body_destroy(body);
}

int main(int argc, char** argv) {
  exmat_model* model = NULL;
  exmat_settings settings;
  double force[3];
  int64_t steps, vertex;
  int axis;
  if (argc != 8) return 3;
  steps = strtoll(argv[3], NULL, 10);
  vertex = strtoll(argv[4], NULL, 10);
  for (axis = 0; axis < 3; ++axis) force[axis] = strtod(argv[5 + axis], NULL);

  check(exmat_model_create_from_scene(argv[1], &model));
  run(model, steps, vertex, NULL);
  check(exmat_settings_default(&settings, sizeof settings));
  settings.time_step = exmat_model_time_step(model);
  exmat_model_destroy(model);

  settings.gravity[1] = -9.81;
  settings.mass_damping = 0.1;
  settings.stiffness_damping = 0.001;
  settings.integrator = EXMAT_NEWMARK;
  settings.use_examples = 1;
  settings.example_stiffness = 100;
  settings.example_damping = 1;
  settings.example_bias = 0.5;
  check(exmat_model_create(argv[2], &settings, &model));
  run(model, steps, vertex, force);
  exmat_model_destroy(model);
  return 0;
}
