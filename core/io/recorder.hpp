#pragma once
// Where a run writes: channels are declared once, then one row per output time.
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace cardan {

/// One recorded quantity: `size` numbers per row. Path below /channels: "bodies/bus/attitude".
struct Channel {
  std::string path;
  std::vector<std::string> components;  // names, one per number: "w","x","y","z"
  std::string unit;                     // one unit for all, or one per component separated by spaces
  std::string frame;                    // axes of a vector ("world", "body bus"); "" = none
  std::string meaning;                  // one line
};

/// Provenance: everything that is known before the first row.
struct RunHeader {
  std::string scenario, title, program_version, compiler, flags, commit;
  std::uint64_t seed = 0;
  std::vector<std::pair<std::string, std::string>> input_hashes;         // file, SHA-256
  std::vector<std::pair<std::string, std::string>> plugins;              // file, SHA-256
  std::vector<std::pair<std::string, std::string>> effective_parameters; // key path, value as read back from the model
  std::vector<std::pair<std::string, std::string>> defaults_used;
  std::string sweep_program;                                             // the program of sweeps that was executed
  std::string spec_text;                                                 // the input files as read
  std::string integrator;
};

class Recorder {
 public:
  virtual ~Recorder() = default;
  virtual void begin(const RunHeader& header, const std::vector<Channel>& channels) = 0;
  /// One row: the numbers of all channels in order of declaration. Throws NumericsError (N0204) when the disk is full.
  virtual void row(double t, std::span<const double> values) = 0;
  /// The state to resume from, and texts that are known at the end ("summary" -> JSON).
  virtual void attach(const std::string& name, const std::string& text) = 0;
  virtual void restart_state(double t, std::span<const double> x) = 0;
  virtual void flush() = 0;
  virtual void close() = 0;
};

/// HDF5 file; flushed every `flush_period` seconds of wall time. Throws InputError (C0701) when it cannot be created.
std::unique_ptr<Recorder> make_hdf5_recorder(const std::string& path, double flush_period = 2.0);
/// Small text output for tests and pipes.
std::unique_ptr<Recorder> make_text_recorder(const std::string& path);

}  // namespace cardan
