-- Beams that bend far, in straight pieces: what turns from piece to piece is large, what each bends small. The error falls with the square of the
-- length of the pieces, and so 8 and 16 of them tell of what it falls to.
local sat = vehicle "vehicle.yaml"
mission { duration = 1e-6 }
local function pieces(chain, n)
  local move = {}
  for i = 1, n do move[i] = ("%s%d.eta"):format(chain, i - 1) end
  return move
end
local function limit(coarse, fine) return fine + (fine - coarse) / 3 end

-- A cantilever that is a bend of 45 degrees of the radius 100 in its plane, 1 by 1, pushed across that by 300 and by 600 at its tip [Bathe & Bolourchi
-- 1979, who have 47.2, 15.9, 53.4 for 600 by 8 elements]. Rods of Cosserat, solved as a boundary value problem in 9 digits, tell these places.
-- Eight pieces are off by 0.3, of which the square of what each turns, a fortieth, remains.
local bend = { [300] = { 58.778897, 22.244679, 40.192392 }, [600] = { 47.150096, 15.684689, 53.475478 } }
local tips = { a = sat:node "a7.tip", b = sat:node "b15.tip" }
local loads = { a = tips.a:load { axes = "world" }, b = tips.b:load { axes = "world" } }
local move = pieces("a", 8)
for _, name in ipairs(pieces("b", 16)) do move[#move + 1] = name end
for force = 100, 600, 100 do
  for _, load in pairs(loads) do load:set(0, 0, 0, 0, 0, force) end
  local found = sat:equilibrium { move = move }
  if not found.reached then error(found.message) end
  initial(found.initial)
  if bend[force] then
    local a, b = { tips.a:position() }, { tips.b:position() }
    for i, axis in ipairs { "x", "y", "z" } do
      local x = limit(a[i], b[i])
      check { name = ("bend, %d, %s"):format(force, axis), unit = "m", value = function() return x end, equal = { bend[force][i], tolerance = 1e-2 } }
    end
  end
end

-- A strip on edge, clamped, with a load at its end tips over sideways at P = 4.0126 sqrt(E I_z G J) / L^2 [Timoshenko & Gere 1961, 6.3]. It sags by
-- I_z / I_y = 1e-4 of what it would across.
local critical = 4.0126 * math.sqrt(70e9 * 5e-10 * 28e9 * 2e-9)
local function border(chain, n)
  local tip, strip = sat:node(("%s%d.tip"):format(chain, n - 1)):load { axes = "world" }, pieces(chain, n)
  local holds, tips_over = 0.9, 1.2
  for _ = 1, 16 do
    local share = (holds + tips_over) / 2
    tip:set(0, 0, 0, 0, 0, share * critical)
    local found = sat:equilibrium { move = strip }
    if not found.reached then error(found.message) end
    if found.statically_stable then holds = share else tips_over = share end
  end
  tip:set(0, 0, 0, 0, 0, 0)
  return holds
end
local share = limit(border("c", 8), border("d", 16))
check { name = "load that tips a strip over", value = function() return share end, equal = { 1, tolerance = 1e-3 } }

-- The run itself begins straight.
local straight = {}
for _, chain in ipairs { { "a", 8 }, { "b", 16 } } do
  for i = 1, chain[2] do straight[chain[1] .. i - 1] = { eta = { 0, 0, 0, 0, 0, 0 } } end
end
for _, load in pairs(loads) do load:set(0, 0, 0, 0, 0, 0) end
initial(straight)
