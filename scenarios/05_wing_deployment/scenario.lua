-- Two wings of four panels unfold. Each is let go by itself: its hinges are unlocked, cables hold its panels in step in pairs, springs drive them.
-- A pair that is straight is caught: its hinges lock, the cable is slack, and what it still had of motion goes through panels and bus as an impulse. The
-- panels bend all the while.

local p = parameters { left = "5 s", right = "9 s", finish = "60 s" }

local sat = vehicle "vehicle.yaml"
local bus = sat:body "bus"

mission {
  title = "two wings of four panels unfold and latch",
  duration = p.finish,
  integrator = { method = "dop853", relative = 1e-10 },
  output = { rate = "10 Hz", nodes = { "left_4.tip", "right_4.tip" }, reactions = { "left_1", "right_1" } },
}

local function let_go(side)
  for i = 1, 4 do sat:unlock(side .. "_" .. i) end
  sat:close(side .. "_inner")
  sat:close(side .. "_outer")
end
phase { name = "stowed", duration = p.left, exit_ = function() let_go "left" end }
phase { name = "left wing", duration = p.right - p.left, exit_ = function() let_go "right" end }
phase { name = "both wings" }

local m = persist { caught = 0, last = 0.0 }
for _, side in ipairs { "left", "right" } do
  for name, pair in pairs { inner = { 1, 2 }, outer = { 3, 4 } } do   -- in the order of their names
    local root = sat:hinge(side .. "_" .. pair[1])
    event { name = side .. " " .. name .. " pair", direction = "falling", once = true, when = function() return root:q() end,
            action = function(t)
              for _, i in ipairs(pair) do sat:lock(side .. "_" .. i) end
              sat:open(side .. "_" .. name)
              m.caught, m.last = m.caught + 1, t
            end }
  end
end

figure { name = "last pair caught at", unit = "s", value = function() return m.last end }
figure { name = "turn of the bus", unit = "deg", value = function() return math.deg(vec.norm(quat.to_rotation_vector { bus:attitude() })) end }
check { name = "pairs caught", unit = "1", value = function() return m.caught end, equal = { 4, tolerance = 0.5 } }
