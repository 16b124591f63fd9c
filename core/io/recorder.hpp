#pragma once
// Where a run writes: channels are declared once, then one row per output time.
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/step_interval.hpp"
#include "core/base/warnings.hpp"

namespace cardan {

/// One recorded quantity: `size` numbers per row. Path below /channels: "bodies/bus/attitude".
struct Channel {
  std::string path;
  std::vector<std::string> components;  // names, one per number: "w","x","y","z"
  std::string unit;                     // one unit for all, or one per component separated by spaces
  std::string frame;                    // axes of a vector ("world", "body bus"); "" = none
  std::string meaning;                  // one line
  std::string commands{};               // path of the attitude that this one commands, "bodies/bus/attitude"; "" = none
};

/// Of the layout of run.h5, as /run@format says: a program reads its own and all below. docs/results.md, "Versions".
inline constexpr int kResultFormat = 2;
class Hdf5File;
/// The format of results; 1 of those that do not say. Throws InputError C0702 where this program does not know it.
int result_format(const Hdf5File& results);

/// Whether the numbers with these names are a quaternion.
inline bool is_attitude(const std::vector<std::string>& components) { return components == std::vector<std::string>{"w", "x", "y", "z"}; }

/// A file of the input: its name as the scenario gives it, the SHA-256 of its bytes and, where it is a text, the text.
struct InputFile {
  std::string name, sha256, text;
};

/// Modes of a body as a picture: points of its mesh, undeformed, lines between them, and how far each mode moves them. Body axes.
struct ModePicture {
  std::vector<std::string> bodies;  // that have these modes
  std::string source;               // one line
  std::vector<double> frequency;    // [Hz] of each of the first modes: those that are pictured
  std::vector<double> points;       // [m] points x 3
  std::vector<std::int64_t> lines;  // lines x 2: indices of points; may be empty
  std::vector<double> shapes;       // [m per unit of the modal coordinate] modes x points x 3
};

/// Provenance: everything that is known before the first row, and all that is needed to run it again.
struct RunHeader {
  using Pairs = std::vector<std::pair<std::string, std::string>>;
  std::string scenario, folder, title;  // file of the scenario, and the absolute path of its folder
  std::string program_version, commit, compiler, flags;
  std::string sweeps, sweep_flags;   // instruction set of the sweeps, and the flags that these were compiled with
  std::vector<std::string> command;  // the command line as given
  Pairs settings;                    // --set: key, value
  std::uint64_t seed = 0;
  std::string until;  // --until in s, its shortest exact digits; empty: not given
  bool check_against_reference = false;
  std::vector<InputFile> inputs;                // texts
  std::vector<InputFile> plugins, modal_files;  // without their content
  Pairs effective_parameters;                   // key path, value as read back from the model, with its unit
  Pairs defaults_used;
  std::string sweep_program;  // the program of sweeps that was executed
  std::string integrator;
  std::size_t most_rows = 0;  // no more rows will come; 0: not known
  std::string resumed;        // times [s] at which the run was resumed: "40, 120"; empty: never
  std::vector<ModePicture> mode_pictures;
};

/// What happens in a run, beside its rows.
enum class Note {
  phase,    // begins: its name, empty after the last
  event,    // its name; "rising" or "falling"
  printed,  // a line; by whom
  warning   // code, what, key path, place, what to do; of each kind the first
};
/// What the texts of a note are called: in run.h5 the columns of /run/events and so on.
struct NoteKind {
  Note kind;
  const char* name;  // of the list: "events"
  std::vector<std::string> columns;
};
const std::vector<NoteKind>& note_kinds();  ///< in the order of Note

class Recorder {
 public:
  virtual ~Recorder() = default;
  virtual void begin(const RunHeader& header, const std::vector<Channel>& channels) = 0;
  /// One row: the numbers of all channels in order of declaration. Throws NumericsError (N0204) when the disk is full.
  virtual void row(double t, std::span<const double> values) = 0;
  /// t: simulated time [s], NaN before the run; texts: one for each column of its kind. Of each kind the first 10000 are kept and the
  /// others counted, and of each text the first 1000 bytes. Where there is no list for them they are dropped. May come before begin().
  virtual void note(Note, double t, const std::vector<std::string>& texts) { static_cast<void>(t), static_cast<void>(texts); }
  /// So many more of a kind were only counted in the results that a run goes on from.
  virtual void left_out(Note, std::size_t more) { static_cast<void>(more); }
  /// How the method went through a stretch of the run: the numbers of StepInterval::columns() and its worst component. Dropped where there
  /// is no place for it.
  virtual void steps(std::span<const double> numbers, const std::string& worst) { static_cast<void>(numbers), static_cast<void>(worst); }
  /// The state to resume from, and texts that are known at the end ("summary" -> JSON).
  virtual void attach(const std::string& name, const std::string& text) = 0;
  virtual void restart_state(double t, std::span<const double> x) = 0;
  /// All that a run goes on from at t, as one text (checkpoint_text.hpp); kept beside the rows so far. Dropped where there is no place for
  /// it.
  virtual void checkpoint(double t, const std::string& text) { static_cast<void>(t), static_cast<void>(text); }
  virtual void flush() = 0;
  /// `verdict`: how the run ended, in a word.
  virtual void close(std::string_view verdict = {}) = 0;
};

void note(Recorder&, const Warning&);
void note(Recorder&, const StepInterval&);

/// HDF5 file; flushed every `flush_period` seconds of wall time. It is made beside `path`; begin() gives it its name, in place of what
/// stood there, once all that stands before the first row is on disk and `ready` has returned: until then, and where either fails, nothing
/// is touched. Throws InputError (C0701) when it cannot be created.
std::unique_ptr<Recorder> make_hdf5_recorder(const std::string& path, double flush_period = 2.0, std::function<void()> ready = {});
/// Small text output for tests and pipes.
std::unique_ptr<Recorder> make_text_recorder(const std::string& path);

}  // namespace cardan
