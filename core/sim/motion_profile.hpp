#pragma once
// Motion of a prescribed velocity component as a function of time: rate, its derivative and its integral. Where the derivative
// jumps, the integrator stops and starts again.
#include <limits>
#include <utility>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/base/diagnostic.hpp"

namespace cardan {

class MotionProfile {
 public:
  /// Keeps the rate it has (v' = 0).
  static MotionProfile hold(double rate = 0.0);
  /// Straight lines between the points (t [s], rate), constant outside. Times increase.
  static MotionProfile rate_table(std::vector<std::pair<double, double>> points);
  /// rate = d/dt of amplitude sin(2 pi frequency t + phase).  [rad or m], [Hz], [rad]
  static MotionProfile sine(double amplitude, double frequency, double phase);

  // Of numbers of type T, double or reference::Quad, at a time of that type.
  template <class T>
  T rate(const T& t) const;
  /// Largest |rate| from t_0 to t_1; of a sine, over a full period.
  double largest_rate(double t_0, double t_1) const;
  /// v' at t, on the stretch between two corners that holds at `since` <= t: a step that ends at a corner belongs to the stretch
  /// before. At a corner, `since` is on the stretch which begins there.
  template <class T>
  T acceleration(const T& t, double since) const;
  /// Integral of the rate.  [rad or m]
  template <class T>
  T travel(const T& from, const T& to) const;
  /// First corner after t; infinity if there is none.
  double next_corner(double t) const;

  void remember(Archive& archive);

 private:
  std::vector<std::pair<double, double>> points_;
  double amplitude_ = 0.0, frequency_ = 0.0, phase_ = 0.0;
};

}  // namespace cardan
