#pragma once
// Signals that ask a run to end: it ends in order, at the next step.
#include <atomic>

#include <csignal>
#include <vector>

namespace cardan {

/// While it lives, SIGINT (Ctrl-C), SIGTERM and SIGHUP (the terminal is gone) set a flag instead of ending the process; those that
/// whoever started the process wants ignored stay ignored. The first one says what is waited for; a second Ctrl-C ends the process at
/// once, and so does another signal that comes a second after the first or later. One at a time.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// Set by a signal, for whoever works and can stop.
  static const std::atomic<bool>& flag();
  /// The signal that came first; 0 = none.
  static int signal();

 private:
  struct Before {
    int number;
    struct sigaction action;
  };
  std::vector<Before> before_;
};

}  // namespace cardan
