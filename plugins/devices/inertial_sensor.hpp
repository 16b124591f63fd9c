#pragma once
// What three gyros and three accelerometers have in common: axes that are turned from the node's and not quite at right angles, errors of
// scale factors, turn-on biases, biases that wander (Gauss-Markov of the first order), white noise, steps of the converter, a range.
// Densities are roots of two-sided spectra, N of N^2 / tau by Allan, so that another rate of sampling has the same [IEEE Std 952-1997].
#include <array>
#include <string>

#include "plugins/devices/readings.hpp"

namespace cardan {

struct InertialSensor {
  double noise, wander, wander_time, step, range;
  double bias[3], seen[9];  // seen: (1 + scale + skew) exp(-misalignment~), row by row: what the axes see of a vector in node axes

  /// The keys of a unit of both; `gyro` and `accelerometer`: unit of the steps of their converters, `step` and `range`: what these are.
  static constexpr std::array<cardan_param_desc, 18> schema(const char* gyro, const char* accelerometer, const char* step,
                                                            const char* range) {
    return {
        param::not_negative(param::optional("angle_random_walk", CARDAN_NUMBER, "1", "white noise of the gyros [rad/sqrt(s)]")),
        param::of_each(
            param::optional("gyro_bias", CARDAN_VECTOR, "rad/s", "of the gyros from the start on: one number for all, or of x, y, z")),
        param::of_each(param::optional("gyro_scale", CARDAN_VECTOR, "1", "errors of their scale factors, likewise")),
        param::optional("gyro_misalignment", CARDAN_VECTOR, "rad", "rotation vector from the node to their axes"),
        param::in_range(param::optional("gyro_nonorthogonality", CARDAN_VECTOR, "rad", kNonorthogonality), -kSkew, kSkew),
        param::not_negative(param::optional("gyro_wander", CARDAN_NUMBER, "rad/s", "standard deviation of their bias in the long run")),
        param::positive(param::optional("gyro_wander_time", CARDAN_NUMBER, "s", "over which their bias forgets", 3600.0)),
        param::not_negative(param::optional("gyro_step", CARDAN_NUMBER, gyro, step)),
        param::not_negative(param::optional("gyro_range", CARDAN_NUMBER, "rad/s", range)),
        param::not_negative(param::optional("velocity_random_walk", CARDAN_NUMBER, "1", "white noise of the accelerometers [m/s/sqrt(s)]")),
        param::of_each(
            param::optional("accelerometer_bias", CARDAN_VECTOR, "m/s^2", "from the start on: one number for all, or of x, y, z")),
        param::of_each(param::optional("accelerometer_scale", CARDAN_VECTOR, "1", "errors of their scale factors, likewise")),
        param::optional("accelerometer_misalignment", CARDAN_VECTOR, "rad", "rotation vector from the node to their axes"),
        param::in_range(param::optional("accelerometer_nonorthogonality", CARDAN_VECTOR, "rad", kNonorthogonality), -kSkew, kSkew),
        param::not_negative(
            param::optional("accelerometer_wander", CARDAN_NUMBER, "m/s^2", "standard deviation of their bias in the long run")),
        param::positive(param::optional("accelerometer_wander_time", CARDAN_NUMBER, "s", "over which their bias forgets", 3600.0)),
        param::not_negative(param::optional("accelerometer_step", CARDAN_NUMBER, accelerometer, step)),
        param::not_negative(param::optional("accelerometer_range", CARDAN_NUMBER, "m/s^2", range))};
  }
  static InertialSensor gyro(const Params& params) { return of(params, "angle_random_walk", "gyro"); }
  static InertialSensor accelerometer(const Params& params) { return of(params, "velocity_random_walk", "accelerometer"); }

  /// What axis i sees of a vector x in node axes.
  double component(int i, const double* x) const noexcept { return seen[3 * i] * x[0] + seen[3 * i + 1] * x[1] + seen[3 * i + 2] * x[2]; }

  /// The bias that has wandered, one period later; of the stationary spread at the first sample.
  double wandered(double before, double period, bool first, double normal) const noexcept {
    const double keep = first ? 0.0 : std::exp(-period / wander_time);
    return keep * before + std::sqrt(1.0 - keep * keep) * wander * normal;
  }

 private:
  static constexpr double kSkew = 0.1;  // [rad] of first order beyond
  static constexpr const char* kNonorthogonality = "by which the angles of y and z, z and x, x and y lack to right ones";

  /// By the keys of its parameters, which begin with `who`.
  static InertialSensor of(const Params& params, const char* noise, const std::string& who) {
    const auto number = [&](const char* key) { return params.number((who + key).c_str()); };
    const auto vector = [&](const char* key) -> Eigen::Vector3d { return params.vector((who + key).c_str()); };
    InertialSensor s{params.number(noise), number("_wander"), number("_wander_time"), number("_step"), number("_range"), {}, {}};
    Eigen::Map<Eigen::Vector3d>(s.bias) = vector("_bias");
    Eigen::Matrix3d errors = vector("_scale").asDiagonal();
    const Eigen::Vector3d lack = vector("_nonorthogonality");
    for (int k = 0; k < 3; ++k) {  // half of it at each of the two axes
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      errors(i, j) = errors(j, i) = 0.5 * lack[k];
    }
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(s.seen) =
        (Eigen::Matrix3d::Identity() + errors) * turned(vector("_misalignment")).toRotationMatrix().transpose();
    return s;
  }
};

}  // namespace cardan
