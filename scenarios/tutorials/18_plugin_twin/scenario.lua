-- The same pendulum three times: on the hinge that comes with Cardan, on one from a plugin that says what it is, and on one that does not. The first
-- two give the same bits, since the same sweeps serve both; the third agrees to rounding. All three are the pendulum of the textbook.

local p = parameters { library = "../../../build/plugins/twin.so" }     -- built with Cardan; README.md builds it by one command
plugin(p.library)

local sat = vehicle "vehicle.yaml"
local built_in, twin, dense = sat:hinge "built_in", sat:hinge "plugin", sat:hinge "dense"

mission {
  title = "a pendulum, its twin from a plugin, and a general hinge",
  duration = "10 s",
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { rate = "20 Hz" },
}

local mass, arm, inertia, g, start = 2, 0.5, 0.2, 9.81, math.rad(75)   -- as in vehicle.yaml, SI
local w, k = math.sqrt(mass * g * arm / (inertia + mass * arm ^ 2)), math.sin(start / 2)
local function truth(t)
  local _, cn, dn = elliptic.jacobi(w * t, k * k)
  return 2 * math.asin(k * cn / dn)
end

local m = persist { twin = 0, dense = 0, truth = 0 }
local function see(name, e) if not (e <= m[name]) then m[name] = e end end   -- a NaN stays
local log = signals { ["twin/difference"] = { unit = "rad", components = { "plugin", "dense" }, meaning = "from the built-in hinge" } }
controller {
  name = "comparison", rate = "20 Hz",
  step = function(t)
    local a = built_in:angle()
    see("twin", math.abs(twin:angle() - a) + math.abs(twin:rate() - built_in:rate()))
    see("dense", math.abs(dense:angle() - a) + math.abs(dense:rate() - built_in:rate()))
    see("truth", math.abs(a - truth(t)))
    log["twin/difference"](twin:angle() - a, dense:angle() - a)
  end,
}

check { name = "plugin that says what it is: the same bits", value = function() return m.twin end, equal = { 0 } }
check { name = "general hinge: to rounding", value = function() return m.dense end, below = 1e-12 }
check { name = "pendulum by elliptic functions", unit = "rad", value = function() return m.truth end, below = 1e-8 }
