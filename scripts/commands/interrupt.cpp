#include "scripts/commands/interrupt.hpp"

#include <cerrno>
#include <ctime>
#include <string_view>

#include <unistd.h>

namespace cardan {
namespace {

std::atomic<bool> asked{false};
std::atomic<int> first_signal{0};
std::atomic<long> first_at{0};  // [ms]
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
              std::atomic<long>::is_always_lock_free);  // so that a signal may set them

constexpr std::string_view kWaits =
    "asked to end: waiting for the step under way, to write the results. A second signal, a second from now, ends the program at once, "
    "with what run.h5 has by then\n";
constexpr long kOneOrder = 1000;  // [ms] programs such as timeout send theirs to the process and to its group

/// Of what it calls all may be called by a signal.
void on_signal(int number) {
  const int error = errno;
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  const long at = 1000 * static_cast<long>(now.tv_sec) + now.tv_nsec / 1'000'000;
  int none = 0;
  if (first_signal.compare_exchange_strong(none, number)) {
    first_at = at;
    asked = true;
    [[maybe_unused]] const auto written = write(STDERR_FILENO, kWaits.data(), kWaits.size());
  } else if (at - first_at >= kOneOrder) {
    std::signal(number, SIG_DFL);
    raise(number);
  }
  errno = error;
}

}  // namespace

Interruption::Interruption() {
  asked = false, first_signal = 0;
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    Before before{number, {}};
    sigaction(number, nullptr, &before.action);
    if (before.action.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART | (number == SIGINT ? static_cast<int>(SA_RESETHAND) : 0);
    sigaction(number, &action, nullptr);
    before_.push_back(before);
  }
}

Interruption::~Interruption() {
  for (const Before& b : before_) sigaction(b.number, &b.action, nullptr);
}

const std::atomic<bool>& Interruption::flag() { return asked; }
int Interruption::signal() { return first_signal; }

}  // namespace cardan
