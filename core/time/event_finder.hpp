#pragma once
// The first zero crossing of the event functions along a step, for any method that can give the state inside its step.
// One rule for all methods; docs/mathematics/integration.md, "Events".
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/time/methods.hpp"

namespace cardan {

class EventFinder {
 public:
  explicit EventFinder(const OdeProblem& problem)
      : problem_(problem),
        n_(static_cast<std::size_t>(problem.n_roots)),
        first_corner_(n_ - static_cast<std::size_t>(problem.n_corners)),
        g_begin_(n_),
        g_end_(n_),
        g_(n_),
        g_before_(n_),
        g_inside_(n_),
        slope_begin_(n_),
        slope_end_(n_),
        slope_before_(n_),
        t_begin_(n_),
        t_cross_(n_),
        crossed_(n_),
        quiet_(n_),
        quiet_before_(n_) {
    parts_.reserve(kDepth);
  }

  std::span<const int> crossed() const { return crossed_; }
  /// Of the event: nothing but corners.
  bool at_corners() const {
    return std::all_of(crossed_.begin(), crossed_.begin() + static_cast<std::ptrdiff_t>(first_corner_), [](int c) { return c == 0; });
  }
  long evaluations() const { return evaluations_; }

  void restart(double t, const double* x) {
    if (t != t_) std::fill(quiet_.begin(), quiet_.end(), 0);  // else: what fired at t stays quiet
    t_ = t;
    evaluate(t, x, g_begin_);
    slopes_known_ = false;
  }

  /// The last find() has not been: nobody went to its event.
  void take_back() {
    t_ = t_before_, quiet_until_ = quiet_until_before_, slopes_known_ = slopes_known_before_;
    std::swap(g_begin_, g_before_), std::swap(quiet_, quiet_before_), std::swap(slope_begin_, slope_before_);
  }

  /// What a restart at the same time keeps.
  void remember(Archive& archive) { archive(std::span(quiet_), quiet_until_, evaluations_); }

  /// Looks at (end of the last search, t_end]. `state_at(t)` gives the state at t in that interval, or at its end; `near_at(t)` one that
  /// may be less accurate, by which corners are located; `beside(t, dt)` that at t + dt, a small way from t, which is the beginning or what
  /// state_at() was asked for last; `rough_at(t)` one that costs next to nothing, by which a long step is divided, or Undivided.
  /// true: t_end becomes the time of the event, crossed() the directions.
  template <class StateAt>
  bool find(double& t_end, StateAt&& state_at) {
    return find(
        t_end, state_at, state_at, [&](double t, double dt) { return state_at(t + dt); }, state_at);
  }
  struct Undivided {};
  template <class StateAt, class NearAt, class Beside, class RoughAt = Undivided>
  bool find(double& t_end, StateAt&& state_at, NearAt&& near_at, Beside&& beside, RoughAt&& rough_at = {}) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    const double whole = t_end - t_, resolution = std::max(1e-13 * whole, 4.0 * eps * std::abs(t_end));

    t_before_ = t_, quiet_until_before_ = quiet_until_, g_before_ = g_begin_, quiet_before_ = quiet_;
    if (!slopes_known_) slopes_known_ = slopes(t_, kWay * whole, g_begin_, slope_begin_, beside);
    slope_before_ = slope_begin_, slopes_known_before_ = slopes_known_;
    parts_.assign(1, t_end);
    const auto beside_near = [&](double t, double dt) { return near_at(t + dt); };
    for (looks_ = 0; !parts_.empty(); parts_.pop_back()) {  // each part as if it were a step
      bool at_end = false;
      for (;; ++looks_) {
        const double end = parts_.back();
        if (parts_.size() == 1) {
          evaluate(end, state_at(end), g_end_);
          at_end = slopes(end, kWay * (t_ - end), g_end_, slope_end_, beside);
        } else {
          evaluate(end, near_at(end), g_end_);
          at_end = slopes(end, kWay * (t_ - end), g_end_, slope_end_, beside_near);
        }
        if constexpr (!std::is_same_v<std::remove_cvref_t<RoughAt>, Undivided>)
          if (looks_ < kMostLooks && parts_.size() < kDepth && at_end && slopes_known_ && bends(end, rough_at)) {
            parts_.push_back(t_ + kInside[0] * (end - t_));
            continue;
          }
        break;
      }
      if (find_in(parts_.back(), resolution, state_at, near_at, beside)) return t_end = t_, true;
      std::swap(g_begin_, g_end_), std::swap(slope_begin_, slope_end_);
      slopes_known_ = at_end;
      t_ = parts_.back();
    }
    return false;
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  static constexpr double kCorner = 1e-6;            // of the step: how near to a corner it ends
  static constexpr double kWay = 1e-3;               // of the interval: over which slopes are differences
  static constexpr int kLooks = 16;                  // for a dip that is in doubt
  static constexpr double kShallow = 1e-12;          // of what it is at the ends: what does not dip deeper has not crossed
  static constexpr double kInside[] = {0.41, 0.71};  // of a step: where it is looked at, and divided first; no simple parts of a period
  static constexpr double kStraight = 0.05;          // of what a function is: by what it may leave a straight line, not looked at
  static constexpr double kCubic = 1e-3;             // of what it is and does in the step: how far it may be from a cubic
  static constexpr double kReach = 8.0;              // times as far from it as it is seen to be: zero may be reached
  static constexpr std::size_t kDepth = 12;          // divisions of divisions
  static constexpr int kMostLooks = 256;
  struct Point {
    double t, g;
  };

  static int sign(double g) { return (g > 0.0) - (g < 0.0); }

  void evaluate(double t, const double* x, std::vector<double>& g) {
    ++evaluations_;
    problem_.roots(t, x, g.data());
    if (const int i = first_not_finite(g.data(), static_cast<int>(n_)); i >= 0)
      fail_integration(Code::not_finite, t, "event function " + std::to_string(i) + " = " + std::to_string(g[i]), {});
  }

  /// false: none in an interval of rounding, which has no inside.
  template <class Beside>
  bool slopes(double t, double way, const std::vector<double>& g, std::vector<double>& slope, Beside& beside) {
    if (std::abs(way) < 4.0 * std::numeric_limits<double>::epsilon() * std::abs(t))
      return std::fill(slope.begin(), slope.end(), 0.0), false;
    evaluate(t + way, beside(t, way), g_);
    for (std::size_t i = 0; i < n_; ++i) slope[i] = (g_[i] - g[i]) / way;
    return true;
  }

  /// Whether a function that may be zero in (t_, t_end) is inside of it far from the cubic by its values and slopes at the ends: it may
  /// have several waves in it, or a corner. One that is nearly straight by these is not looked at.
  template <class RoughAt>
  bool bends(double t_end, RoughAt& rough_at) {
    const double h = t_end - t_;
    const auto may = [&](std::size_t i) {
      const double line = (g_end_[i] - g_begin_[i]) / h,
                   off = h * std::max(std::abs(slope_begin_[i] - line), std::abs(slope_end_[i] - line));
      return off > kStraight * std::min(std::abs(g_begin_[i]), std::abs(g_end_[i]));
    };
    bool any = false;
    for (std::size_t i = 0; i < n_ && !any; ++i) any = may(i);
    if (!any) return false;
    evaluate(t_ + kInside[0] * h, rough_at(t_ + kInside[0] * h), g_inside_);
    evaluate(t_ + kInside[1] * h, rough_at(t_ + kInside[1] * h), g_);
    const double noise = h < 0.1 * (parts_.front() - t_before_) ? 0.05 : 0.25;
    for (std::size_t i = 0; i < n_; ++i) {
      if (!may(i)) continue;
      const double a = g_begin_[i], b = g_end_[i], m = h * slope_begin_[i], n = h * slope_end_[i],
                   size = std::max(std::abs(a), std::abs(b)), change = std::max(std::abs(m), std::abs(n));
      const auto [least, most] = std::minmax({a, b, g_inside_[i], g_[i]});
      if (kWay * change > noise * (most - least)) continue;  // over a thousandth it differs as over all of it: rounding
      if (turns(a, b, m, n, kCubic * (size + change))) return true;
      for (std::size_t k = 0; k < std::size(kInside); ++k) {
        const double s = kInside[k], r = 1.0 - s, g = k == 0 ? g_inside_[i] : g_[i],
                     cubic = r * r * (1.0 + 2.0 * s) * a + s * s * (1.0 + 2.0 * r) * b + s * r * (r * m - s * n), off = std::abs(g - cubic);
        if (sign(a) == sign(b) && sign(a) != sign(g)) return true;
        if ((sign(a) != sign(b) || kReach * off > std::min({std::abs(a), std::abs(b), std::abs(g)})) && off > kCubic * (size + change))
          return true;
      }
    }
    return false;
  }

  /// Whether the cubic with the values a, b and slopes m, n at the ends of [0, 1] may be zero more than once inside, or twice where dip()
  /// does not look for it.
  static bool turns(double a, double b, double m, double n, double margin) {
    const double side = sign(b), c2 = 3.0 * (b - a) - 2.0 * m - n, c3 = 2.0 * (a - b) + m + n, under = c2 * c2 - 3.0 * c3 * m;
    if (!(under > 0.0)) return false;
    const double q = -(c2 + std::copysign(std::sqrt(under), c2));  // where its slope is zero: q / (3 c3) and m / q
    const auto [first, second] = std::minmax({q / (3.0 * c3), m / q});
    const auto is_inside = [](double u) { return u > 0.0 && u < 1.0; };
    const auto at = [&](double u) { return side * (a + u * (m + u * (c2 + u * c3))); };
    if (sign(a) != sign(b)) return is_inside(first) && is_inside(second) && at(first) > -margin && at(second) < margin;
    if (side * m < 0.0 && side * n > 0.0) return false;
    return (is_inside(first) && at(first) < margin) || (is_inside(second) && at(second) < margin);
  }

  /// In (t_, t_end], where values and slopes at both ends are known: t_ becomes the time of the event.
  template <class StateAt, class NearAt, class Beside>
  bool find_in(double t_end, double resolution, StateAt& state_at, NearAt& near_at, Beside& beside) {
    const double window = 100.0 * resolution;
    std::fill(t_begin_.begin(), t_begin_.end(), t_);
    leave_zero(std::max(quiet_until_, t_ + window), t_end, state_at);

    const auto beside_near = [&](double t, double dt) { return near_at(t + dt); };
    double first = kNever;
    for (std::size_t i = 0; i < n_; ++i) {
      t_cross_[i] = kNever;
      if (g_begin_[i] == 0.0) continue;
      if (i < first_corner_ && parts_.size() > 1 && sign(g_begin_[i]) != sign(g_end_[i])) {  // by what lies inside of a step alone
        evaluate(t_end, state_at(t_end), g_);
        g_end_[i] = g_[i];
        if (sign(g_begin_[i]) == sign(g_end_[i])) {
          looks_ += kLooks;
          continue;
        }
      }
      Point beyond{t_end, g_end_[i]};
      if (sign(g_begin_[i]) == sign(g_end_[i]))
        beyond =
            i < first_corner_ ? dip(i, t_end, resolution, 0.5, state_at, beside) : dip(i, t_end, resolution, 1.0, near_at, beside_near);
      if (beyond.t == kNever) continue;
      t_cross_[i] = i < first_corner_ ? locate(i, beyond, resolution, state_at)
                                      : locate(i, beyond, std::max(resolution, kCorner * (t_end - t_)), near_at);
      first = std::min(first, t_cross_[i]);
    }
    if (first == kNever) return false;
    slopes_known_ = false;
    double t_event = first;  // crossings closer than the window are one event, at the last of them
    for (const double t : t_cross_)
      if (t <= first + window) t_event = std::max(t_event, t);
    evaluate(t_event, state_at(t_event), g_);
    for (std::size_t i = 0; i < n_; ++i) {
      // This state tells which have passed: the next step begins at it, whatever rounding let be located a little before or later.
      const int side = sign(g_begin_[i]);
      crossed_[i] = (i < first_corner_ ? sign(g_[i]) != side : t_cross_[i] <= t_event) ? -side : 0;
      quiet_[i] = static_cast<signed char>(crossed_[i]);
    }
    std::swap(g_begin_, g_);
    quiet_until_ = t_event + window;
    t_ = t_event;
    return true;
  }

  /// Between two ends of one sign: where it has the other one; kNever where that is not seen. The tangents at both ends lie below a
  /// function that bends towards them: as long as they meet beyond zero, it is looked at there, and its tangent there takes the place of
  /// one of them. doubt: of what it is at the ends; for one that bends both ways the first kLooks are made where they meet below that.
  template <class StateAt, class Beside>
  Point dip(std::size_t i, double t_end, double resolution, double doubt, StateAt& state_at, Beside& beside) {
    const double side = sign(g_end_[i]);
    struct End {
      double t, g, slope;
    } a{t_begin_[i], side * g_begin_[i], side * slope_begin_[i]}, b{t_end, side * g_end_[i], side * slope_end_[i]};
    const double least = -kShallow * std::max(a.g, b.g);
    for (int looks = kLooks; a.slope < 0.0 && b.slope > 0.0 && b.t - a.t > resolution; --looks) {
      const double length = b.t - a.t, meet = (a.g - b.g + b.slope * length) / (b.slope - a.slope);
      if (a.g + a.slope * meet >= (looks > 0 ? doubt * std::max(a.g, b.g) : least)) break;
      const double to = meet > 0.0 && meet < length && looks % 3 != 0 ? meet : 0.5 * length, t = a.t + to,
                   way = 2.0 * to < length ? kWay * length : -kWay * length;
      evaluate(t, state_at(t), g_);
      const double g = g_[i];
      if (side * g < 0.0) return {t, g};
      evaluate(t + way, beside(t, way), g_);
      const End middle{t, side * g, side * (g_[i] - g) / way};
      (middle.slope < 0.0 ? a : b) = middle;
    }
    return {kNever, 0.0};
  }

  /// A function that fired at the beginning, or is zero there, takes its sign from a little later: round-off around the
  /// zero it starts from is no crossing, and a bounce that comes down again within the step is one.
  template <class StateAt>
  void leave_zero(double t_quiet, double t_end, StateAt& state_at) {
    bool evaluated = false;
    for (std::size_t i = first_corner_; i < n_; ++i)  // on the side to which it passed, or nearly
      if (const signed char side = std::exchange(quiet_[i], 0); side * g_begin_[i] < 0.0 || (side != 0 && g_begin_[i] == 0.0))
        g_begin_[i] = side * std::numeric_limits<double>::min();
    for (std::size_t i = 0; i < n_; ++i) {
      const bool starts_at_zero = g_begin_[i] == 0.0 && g_end_[i] != 0.0;
      if (!quiet_[i] && !starts_at_zero) continue;
      if (t_quiet >= t_end) {
        g_begin_[i] = 0.0;
        continue;
      }
      if (!evaluated) evaluate(t_quiet, state_at(t_quiet), g_);
      evaluated = true;
      g_begin_[i] = g_[i];
      t_begin_[i] = t_quiet;
    }
    if (t_quiet < t_end) std::fill(quiet_.begin(), quiet_.end(), 0);
  }

  /// Regula falsi with the weights of Anderson and Bjorck (1973): an end that stays counts less, by how far the function went towards zero
  /// on the other side. Where three looks leave more than a quarter of the bracket, one in the middle. Returns the end of the last bracket
  /// where the sign is the new one.
  template <class StateAt>
  double locate(std::size_t i, const Point& beyond, double resolution, StateAt& state_at) {
    Point a{t_begin_[i], g_begin_[i]}, b = beyond;
    const int before_it = sign(a.g);  // weights may take a.g itself to zero
    double before = b.t - a.t;        // the bracket, up to three looks ago
    int stayed = 0;                   // which end: -1 a, +1 b
    bool halve = false;
    for (int k = 1; b.t - a.t > resolution; ++k) {
      const double guess = halve ? 0.5 * (a.t + b.t) : b.t - b.g * (b.t - a.t) / (b.g - a.g);
      const double t = std::clamp(guess, a.t + 0.5 * resolution, b.t - 0.5 * resolution);
      evaluate(t, state_at(t), g_);
      const bool is_beyond = sign(g_[i]) != before_it;
      Point &moves = is_beyond ? b : a, &stays = is_beyond ? a : b;
      if (const int side = is_beyond ? -1 : 1; std::exchange(stayed, side) == side)
        stays.g *= std::abs(g_[i]) < std::abs(moves.g) ? 1.0 - g_[i] / moves.g : 0.5;
      moves = {t, g_[i]};
      halve = false;
      if (k % 3 == 0) halve = b.t - a.t > 0.25 * std::exchange(before, b.t - a.t);
    }
    return b.t;
  }

  const OdeProblem& problem_;
  std::size_t n_, first_corner_;  // those from here on are corners
  double t_ = 0.0, quiet_until_ = -kNever;

  double t_before_ = 0.0, quiet_until_before_ = -kNever;  // [s] as they were before the last find(), as g_before_ and quiet_before_
  std::vector<double> g_begin_, g_end_, g_, g_before_, g_inside_, slope_begin_, slope_end_, slope_before_, t_begin_, t_cross_;
  bool slopes_known_ = false, slopes_known_before_ = false;  // at the beginning
  std::vector<double> parts_;                                // [s] ends of parts of a step, the next one last
  int looks_ = 0;  // at parts, of kMostLooks; what is inside of a step and was not so counts for kLooks
  std::vector<int> crossed_;
  std::vector<signed char> quiet_, quiet_before_;  // the direction in which one fired that is not to fire again yet
  long evaluations_ = 0;
};

}  // namespace cardan
