#include "plugins/devices/register.hpp"

#include "plugins/fields/register.hpp"

namespace cardan {

const cardan_device_family& spring_damper_family();
const cardan_device_family& lugre_friction_family();
const cardan_device_family& momentum_wheel_family();
const cardan_device_family& imu_family();
const cardan_device_family& integrating_imu_family();
const cardan_device_family& dry_friction_family();
const cardan_device_family& tank_family();
const cardan_device_family& thruster_family();
const cardan_device_family& magnetorquer_family();
const cardan_device_family& dc_motor_family();
const cardan_device_family& tape_spring_family();
const cardan_device_family& latch_family();
const cardan_device_family& contact_family();
const cardan_device_family& drag_family();
const cardan_device_family& plate_drag_family();
const cardan_device_family& radiation_pressure_family();
const cardan_device_family& pulse_modulator_family();
const cardan_device_family& pulsed_thruster_family();
const cardan_device_family& star_tracker_family();
const cardan_device_family& sun_sensor_family();
const cardan_device_family& coarse_sun_sensor_family();
const cardan_device_family& magnetometer_family();
const cardan_device_family& encoder_family();
const cardan_device_family& bushing_family();
const cardan_device_family& cable_family();
const cardan_device_family& horizon_sensor_family();
const cardan_device_family& gnss_family();
const cardan_device_family& recorded_load_family();
const cardan_device_family& vibration_family();
const cardan_device_family& wheel_disturbance_family();
const cardan_device_family& rotor_disturbance_family();
const cardan_device_family& stepper_family();

void register_devices(Registry& registry) {
  register_fields(registry);
  for (const auto family : {spring_damper_family,
                            lugre_friction_family,
                            momentum_wheel_family,
                            imu_family,
                            integrating_imu_family,
                            dry_friction_family,
                            tank_family,
                            thruster_family,
                            magnetorquer_family,
                            dc_motor_family,
                            tape_spring_family,
                            latch_family,
                            contact_family,
                            drag_family,
                            plate_drag_family,
                            radiation_pressure_family,
                            pulse_modulator_family,
                            pulsed_thruster_family,
                            star_tracker_family,
                            sun_sensor_family,
                            coarse_sun_sensor_family,
                            magnetometer_family,
                            encoder_family,
                            bushing_family,
                            cable_family,
                            horizon_sensor_family,
                            gnss_family,
                            stepper_family,
                            rotor_disturbance_family,
                            wheel_disturbance_family,
                            vibration_family,
                            recorded_load_family})
    registry.devices.add(family());
}

}  // namespace cardan
