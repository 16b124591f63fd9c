#pragma once
// What the program is busy with. When memory runs out, this tells in what.
#include <exception>
#include <string>

namespace cardan {

class Activity {
 public:
  /// `what` completes "not enough memory for": "the modes of bodies.wing".
  explicit Activity(std::string what) : what_(std::move(what)) { ended_.clear(); }
  /// The innermost one that an exception ends is remembered; nothing is allocated.
  ~Activity() {
    if (std::uncaught_exceptions() > exceptions_ && ended_.empty()) ended_.swap(what_);
  }
  Activity(const Activity&) = delete;
  Activity& operator=(const Activity&) = delete;

  /// What an exception ended last; empty: none of these.
  static const std::string& ended() { return ended_; }

 private:
  std::string what_;
  int exceptions_ = std::uncaught_exceptions();
  inline static thread_local std::string ended_;
};

}  // namespace cardan
