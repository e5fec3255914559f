#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <optional>

#include "common/core/atomic_file.h"
#include "common/core/command_files.h"
#include "common/core/error.h"
#include "common/core/log.h"
#include "runtime/viewer/app/dump.h"
#include "runtime/viewer/app/hand.h"
#include "runtime/viewer/app/options.h"
#include "runtime/viewer/app/window.h"
#include "runtime/viewer/panels/interface.h"
#include "runtime/viewer/recording/recording.h"
#include "runtime/viewer/script/script.h"

namespace exmat::viewer {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kSamples = 4;  // of a pixel

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

std::vector<SceneDocument> open_documents(const Options& options) {
  std::vector<SceneDocument> documents{SceneDocument::open(options.files.front())};
  for (std::size_t i = 1; i < options.files.size(); ++i)
    documents.push_back(documents.front().with_bundle(options.files[i]));
  return documents;
}

/// Before anything is read: a file that is then read is refused.
void claim_outputs(const Options& options) {
  if (options.record) claim_recording(*options.record);
  if (options.screenshot) claim_output(*options.screenshot, "--screenshot");
  if (options.save_scene) claim_output(*options.save_scene, "--save-scene");
  if (options.dump) claim_output(*options.dump, "--dump");
}

/// Names what the library will read, which knows nothing of the outputs, and says itself what is missing.
void check_inputs(const std::vector<SceneDocument>& documents) {
  std::error_code ignored;
  for (const SceneDocument& document : documents)
    for (const std::filesystem::path& file : document.files())
      if (std::filesystem::exists(file, ignored)) check_input(file, "a file of the scene");
}

std::vector<ShownBody> shown_bodies(const Studio& studio) {
  std::vector<ShownBody> bodies;
  for (std::size_t i = 0; i < studio.offsets().size(); ++i)
    bodies.push_back({studio.kinds_of_bodies()[i], studio.offsets()[i]});
  return bodies;
}

std::string save_name(const std::filesystem::path& file) { return file.stem().string() + "_saved.json"; }

/// A window, what is in it, and what is drawn over that.
class Show {
 public:
  Show(const Options& options, Studio& studio)
      : studio_(studio),
        window_(options.size, !options.by_itself()),
        canvas_(std::in_place, options.by_itself() ? options.size : window_.size(), kSamples),
        drawing_(studio.shapes(), shown_bodies(studio), window_.is_software()),
        interface_(options.by_itself() ? nullptr : window_.get(),
                   static_cast<float>(options.scale.value_or(options.by_itself() ? 1 : window_.scale())),
                   options.files.front().stem().string(), save_name(options.files.front())) {
    log::info(fmt::format("drawn by {}", window_.renderer()));
  }

  Window& window() { return window_; }
  Canvas& canvas() { return *canvas_; }
  const SceneDrawing& drawing() const { return drawing_; }

  void fit_window() {
    const PictureSize size = window_.size();
    if (size.width != canvas_->size().width || size.height != canvas_->size().height) canvas_.emplace(size, kSamples);
  }

  void begin(double seconds) { interface_.begin(canvas_->size(), seconds); }

  /// Notes for the plots a picture that need not be drawn.
  std::shared_ptr<const Snapshot> note() {
    if (studio_.look().request() != request_) {
      request_ = studio_.look().request();
      studio_.runner().set_request(request_);
      studio_.runner().refresh();
    }
    std::shared_ptr<const Snapshot> snapshot = studio_.runner().latest();
    interface_.note(*snapshot, studio_.runner().take_times());
    return snapshot;
  }

  /// Throws WorkError where GL has noted an error.
  void draw(const Snapshot& snapshot, double seconds, double frame_seconds) {
    drawing_.draw(snapshot, studio_.camera(), studio_.look(), *canvas_);
    if (studio_.frame_next) {
      studio_.frame(drawing_.bounds(), canvas_->size(), interface_.scale());
      drawing_.draw(snapshot, studio_.camera(), studio_.look(), *canvas_);
    }
    // The panels find their sizes by being drawn; the first times are not looked at.
    for (; unsettled_ > 0; --unsettled_) {
      interface_.draw(snapshot, drawing_, studio_, canvas_->size(), frame_seconds);
      canvas_->resolve();
      interface_.begin(canvas_->size(), seconds);
    }
    interface_.draw(snapshot, drawing_, studio_, canvas_->size(), frame_seconds);
    if (const std::string error = take_gl_error(); !error.empty()) throw WorkError(error);
  }

 private:
  Studio& studio_;
  Window window_;
  std::optional<Canvas> canvas_;
  SceneDrawing drawing_;
  Interface interface_;
  SnapshotRequest request_;
  int unsettled_ = 3;
};

/// In real time, until the window is closed.
void run_window(Show& show, Studio& studio) {
  Hand hand;
  studio.runner().start();
  double frame_seconds = 1.0 / 60;
  Clock::time_point last = Clock::now();
  while (!show.window().closed() && !studio.end) {
    const double seconds = seconds_since(last);
    last = Clock::now();
    frame_seconds += 0.1 * (seconds - frame_seconds);
    show.fit_window();
    show.begin(seconds);
    hand.act(studio, show.canvas().size(), show.window().take_keys());
    if (studio.runner().paused()) studio.runner().refresh();
    show.draw(*show.note(), seconds, frame_seconds);
    studio.pass(seconds);
    if (studio.interface) studio.measure_lost_work(seconds);
    show.canvas().show(show.window().size());
    show.window().show_next();
  }
}

struct Measured {
  double simulation = 0, drawing = 0;  ///< [s], of all pictures
  int pictures = 0;
};

void print_times(const Measured& measured, const Show& show, const Studio& studio) {
  const double pictures = std::max(measured.pictures, 1);
  fmt::print("bodies {}\ntriangles {}\nsimulation {:.3f} ms a picture\ndrawing {:.3f} ms a picture\n",
             studio.offsets().size(), show.drawing().triangles(), 1e3 * measured.simulation / pictures,
             1e3 * measured.drawing / pictures);
}

/// At fixed time: the same pictures each time.
void run_by_itself(const Options& options, Show& show, Studio& studio) {
  std::optional<ScriptPlayer> player;
  double frame_rate = 60, duration = 0;
  if (options.script) {
    Script script = load_script(*options.script);
    frame_rate = script.frame_rate;
    duration = script.duration;
    player.emplace(std::move(script), studio);
  }
  frame_rate = options.frame_rate.value_or(frame_rate);
  const int frames = options.frames.value_or(static_cast<int>(std::lround(duration * frame_rate)));
  std::optional<Recording> recording;
  if (options.record) recording.emplace(*options.record, frame_rate, show.canvas().size());
  Measured measured;
  std::shared_ptr<const Snapshot> snapshot;
  for (int frame = 0; frame <= frames; ++frame) {
    // The first picture is that of the start.
    Clock::time_point begin = Clock::now();
    if (frame > 0) studio.runner().advance(1 / frame_rate);
    if (player) player->play(frame / frame_rate);
    studio.runner().refresh();
    snapshot = show.note();
    measured.simulation += seconds_since(begin);
    const bool last = frame == frames;
    if (!recording && !options.time && !last) continue;
    if (studio.interface || options.dump) studio.measure_lost_work_now();
    begin = Clock::now();
    show.begin(1 / frame_rate);
    show.draw(*snapshot, 1 / frame_rate, 0);
    if (options.time) glFinish();
    measured.drawing += seconds_since(begin);
    ++measured.pictures;
    if (recording) recording->add(show.canvas().read());
  }
  if (recording) recording->finish();
  if (options.screenshot) write_png(show.canvas().read(), *options.screenshot);
  if (!snapshot->failure.empty()) throw WorkError(snapshot->failure);
  studio.runner().with([&](Simulation& simulation) {
    if (options.save_scene) simulation.save_scene(*options.save_scene);
    if (options.dump) dump(*snapshot, studio, show.canvas().size(), *options.dump);
    fmt::print("steps {}\nstate hash {:016x}\n", simulation.steps(), simulation.hash());
  });
  if (options.time) print_times(measured, show, studio);
}

}  // namespace

void run(const Options& options) {
  claim_outputs(options);
  if (options.script) load_script(*options.script);  // its faults before anything is made
  std::vector<SceneDocument> documents = open_documents(options);
  check_inputs(documents);
  Simulation simulation(std::move(documents), options.object_surface ? EXMAT_SURFACE_OBJECT : EXMAT_SURFACE_AUTO);
  Studio studio(simulation);
  studio.interface = !options.hide_interface;
  Show show(options, studio);
  if (options.by_itself())
    run_by_itself(options, show, studio);
  else
    run_window(show, studio);
}

}  // namespace exmat::viewer
