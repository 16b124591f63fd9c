#pragma once
// What gyros and accelerometers have in common, of one axis: white noise, a turn-on bias, a bias that wanders (Gauss-Markov of the first
// order), steps of the converter, a range. Densities are of one-sided spectra per root of a rate, so that another rate of sampling has the
// same spectrum [IEEE Std 952-1997].
#include <array>

#include "plugins/devices/readings.hpp"

namespace cardan {

struct InertialSensor {
  double noise, bias, wander, wander_time, step, range;

  /// The keys of a unit of both; `gyro` and `accelerometer`: unit of the steps of their converters, `step` and `range`: what these are.
  static constexpr std::array<cardan_param_desc, 12> schema(const char* gyro, const char* accelerometer, const char* step,
                                                            const char* range) {
    return {
        param::not_negative(param::optional("angle_random_walk", CARDAN_NUMBER, "1", "white noise of the gyros [rad/sqrt(s)]")),
        param::optional("gyro_bias", CARDAN_NUMBER, "rad/s", "of each gyro from the start on"),
        param::not_negative(param::optional("gyro_wander", CARDAN_NUMBER, "rad/s", "standard deviation of their bias in the long run")),
        param::positive(param::optional("gyro_wander_time", CARDAN_NUMBER, "s", "over which their bias forgets", 3600.0)),
        param::not_negative(param::optional("gyro_step", CARDAN_NUMBER, gyro, step)),
        param::not_negative(param::optional("gyro_range", CARDAN_NUMBER, "rad/s", range)),
        param::not_negative(param::optional("velocity_random_walk", CARDAN_NUMBER, "1", "white noise of the accelerometers [m/s/sqrt(s)]")),
        param::optional("accelerometer_bias", CARDAN_NUMBER, "m/s^2", "of each from the start on"),
        param::not_negative(
            param::optional("accelerometer_wander", CARDAN_NUMBER, "m/s^2", "standard deviation of their bias in the long run")),
        param::positive(param::optional("accelerometer_wander_time", CARDAN_NUMBER, "s", "over which their bias forgets", 3600.0)),
        param::not_negative(param::optional("accelerometer_step", CARDAN_NUMBER, accelerometer, step)),
        param::not_negative(param::optional("accelerometer_range", CARDAN_NUMBER, "m/s^2", range))};
  }
  /// By the keys of its parameters.
  static InertialSensor of(const Params& params, const char* noise, const char* bias, const char* wander, const char* wander_time,
                           const char* step, const char* range) {
    const auto n = [&](const char* key) { return params.number(key); };
    return {n(noise), n(bias), n(wander), n(wander_time), n(step), n(range)};
  }
  static InertialSensor gyro(const Params& params) {
    return of(params, "angle_random_walk", "gyro_bias", "gyro_wander", "gyro_wander_time", "gyro_step", "gyro_range");
  }
  static InertialSensor accelerometer(const Params& params) {
    return of(params, "velocity_random_walk", "accelerometer_bias", "accelerometer_wander", "accelerometer_wander_time",
              "accelerometer_step", "accelerometer_range");
  }

  /// The bias that has wandered, one period later; of the stationary spread at the first sample.
  double wandered(double before, double period, bool first, double normal) const noexcept {
    const double keep = first ? 0.0 : std::exp(-period / wander_time);
    return keep * before + std::sqrt(1.0 - keep * keep) * wander * normal;
  }
};

}  // namespace cardan
