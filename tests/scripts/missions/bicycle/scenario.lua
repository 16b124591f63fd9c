-- The bicycle of Whipple with the numbers of Meijaard, Papadopoulos, Ruina & Schwab (2007, Table 1), rolling straight ahead at 5 m/s: its poles
-- are those of their Table 2. Wheels that roll are here rims that press on a plane and creep by a little.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 ms", integrator = { method = "cvode_bdf" }, output = { rate = "1 kHz" } }
local speed, base, weight, stiffness = 5, 1.02, 94 * 9.81, 1e8
local front = weight * (85 * 0.3 + 4 * 0.9 + 3 * base) / 94 / base
local sink_rear, sink_front = (weight - front) / stiffness, front / stiffness
initial {
  frame = { position = { 0, 0, sink_rear }, velocity = { speed, 0, 0 }, orientation = { axis = { 0, 1, 0 }, angle = (sink_rear - sink_front) / base } },
  rear = { rate = -speed / (0.3 - sink_rear / 2) },
  front = { rate = -speed / (0.35 - sink_front / 2) },
}
local poles = sat:linearize {}.poles
-- Rims sink by 6e-6 m of 0.3 m, and creep as a damper of the weight over the width, 5e7 N s/m, would let them: 1e-5 and less of what accelerates
-- them, some 10 /s^2 for each 1/s, of which the slow poles are what remains of sums.
local function pole(name, re, im)
  local function off()
    local least = math.huge
    for _, p in ipairs(poles) do least = math.min(least, math.sqrt((p.re - re) ^ 2 + (p.im - im) ^ 2)) end
    return least
  end
  check { name = name, unit = "1/s", value = off, below = 2e-4 }
end
pole("weave", -0.775341882195845, 4.464867771378823)
pole("capsize", -0.322866429004087, 0)
pole("castering", -14.078389692796822, 0)
