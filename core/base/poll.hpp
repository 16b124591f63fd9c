#pragma once
// Work that takes long lets whoever started it say whether it may go on: a person at a prompt, the budget of a script.
#include <functional>
#include <utility>

namespace cardan {

/// While one lives, Poll::now() calls its function on this thread; the function may throw to end the work. They nest.
class Poll {
 public:
  explicit Poll(std::function<void()> look) : look_(std::move(look)), outer_(std::exchange(innermost_, this)) {}
  ~Poll() { innermost_ = outer_; }
  Poll(const Poll&) = delete;
  Poll& operator=(const Poll&) = delete;

  /// For loops whose passes take microseconds or more: columns of a matrix, iterations. Costs a look at a pointer.
  static void now() {
    if (innermost_ != nullptr) innermost_->look_();
  }

 private:
  std::function<void()> look_;
  Poll* outer_;
  inline static thread_local Poll* innermost_ = nullptr;
};

}  // namespace cardan
