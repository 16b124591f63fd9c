-- A double pendulum that is let go from far above the horizontal moves chaotically: two runs that differ by little drift apart exponentially.
-- So its motion can be compared for as long as the digits last; the truth has 40 of them (truth.py), a double 16.

local known = {   -- upper and lower angle [rad], upper and lower rate [rad/s] at 1, 2, ... 6 s, by truth.py
  { -0.4349910482763815649, -0.71784234510460782649, -1.166433471034212478, -5.1250727127693494052 },
  { -0.68936008196610056775, -1.4063545675715932814, 3.0137476970264194612, 0.0050625480782833884198 },
  { 1.9537302605340864059, -1.048024342928071366, 2.025093489884420559, -3.3130170619810249585 },
  { -1.0601077437579307815, 1.6300921257090987463, -4.6742076321244962929, 3.0230880231193749348 },
  { 0.58515291675952138202, -2.1928738099492281498, 4.3243824366511854438, 1.4737590086056451775 },
  { 0.043283334193181744715, 5.171693646490209729, -3.6043751995693987917, 11.121269364746197347 },
}

local sat = vehicle "vehicle.yaml"
local upper, lower = sat:hinge "upper", sat:hinge "lower"

mission {
  title = "a chaotic double pendulum beside 40 digits",
  duration = "6 s",
  integrator = { method = "dopri5", relative = 1e-12 },
  output = { rate = "50 Hz", nodes = { "lower.end" } },
}

local errors = persist {}                 -- [rad] at whole seconds
controller {
  name = "comparison", rate = "1 Hz",
  step = function(t)
    if t == 0 then return end
    local now = { upper:angle(), lower:angle(), upper:rate(), lower:rate() }
    local sum = 0
    for i = 1, 4 do sum = sum + (now[i] - known[t][i]) ^ 2 end
    errors[t] = math.sqrt(sum)
  end,
}

-- Steps of 1e-12 make 1e-11 in the first second; from then on the motion multiplies it, each second by about two.
for t, limit in ipairs { 1e-10, 1e-10, 3e-10, 3e-10, 1e-9, 3e-9 } do
  check { name = string.format("distance from the truth at %d s", t), value = function() return errors[t] end, below = limit }
end
