#include "scripts/commands/interrupt.hpp"

namespace cardan {
namespace {

std::atomic<bool> asked{false};
std::atomic<int> first_signal{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free);  // so that a signal may set them

void on_signal(int number) {
  int none = 0;
  first_signal.compare_exchange_strong(none, number);
  asked = true;
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
