#pragma once
// Work that may crash, never end or end its process, done in a copy of this one: what happens to the copy does not happen here.
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cardan {

#if defined(__SANITIZE_ADDRESS__)
#define CARDAN_ADDRESS_CHECKS 1  // these reserve terabytes of addresses: memory is not limited then
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CARDAN_ADDRESS_CHECKS 1
#endif
#endif

struct ChildLimits {
  double cpu_s = 20.0;                                      // of processor time, so that a busy machine changes nothing
  double wall_s = std::numeric_limits<double>::infinity();  // [s] in all: a child that waits for ever computes nothing
  std::size_t memory = std::size_t{4} << 30;                // [bytes] beyond what this process has, and of the answer
  std::size_t file_size = 0;                                // [bytes] of each file that it writes; 0: any
};

struct ChildEnd {
  enum class How {
    ended,       // by itself, `status` is its exit status: 0 when the work returned
    killed,      // by the signal `status`
    late,        // wall_s were over
    not_started  // there is no such process; `status` is errno
  };
  How how;
  int status;
  std::string said;  // all that the work gave to `say`
};

/// Hands bytes to the parent at once: they are there even if the next statement crashes.
using Say = std::function<void(std::string_view)>;

/// Runs `work` in a copy of this process that prints nothing, leaves no core and flushes nothing of this process's. An
/// exception of the work ends the child with a status other than 0, as do exit() and _exit() with theirs. Interrupts (SIGINT, SIGTERM,
/// SIGHUP) are this process's: it looks at Poll::now() while it waits, and what that throws ends the child and is thrown on.
ChildEnd run_in_child(const std::function<void(const Say&)>& work, const ChildLimits& limits);

/// Another program, or this one anew, beside this process: what it prints goes to files. It dies with this process.
struct ProgramOrder {
  std::vector<std::string> command;                                // the program by its path, then its arguments
  std::vector<std::pair<std::string, std::string>> environment{};  // set beside what this process has
  std::string out = "/dev/null", err = "/dev/null";                // files that standard output and standard error go to
  ChildLimits limits{};                                            // memory: [bytes] of addresses in all
};

class RunningProgram {
 public:
  /// Starts it. A program that cannot be started has `ended()` at once.
  explicit RunningProgram(const ProgramOrder& order);
  ~RunningProgram();  // kills what still runs
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  /// Whether it has ended; kills it where its time is over.
  bool has_ended();
  const ChildEnd& end() const { return end_; }  ///< once it has
  double wall_s() const { return wall_s_; }     ///< [s] that it took, once it has ended
  double cpu_s() const { return cpu_s_; }       ///< [s] of processor time, likewise

 private:
  int pid_ = -1;
  ChildLimits limits_;
  ChildEnd end_;
  double started_ = 0.0, wall_s_ = 0.0, cpu_s_ = 0.0;  // [s]
};

}  // namespace cardan
