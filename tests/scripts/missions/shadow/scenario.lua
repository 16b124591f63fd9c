-- Eight edges of the Earth's shadow, each passed in 8 s, and how far off they leave an orbit: docs/mathematics/astronomy.md, 6.
local p = parameters { method = "dop853", relative = 1e-9, max_step = "30 s" }
local sat = vehicle "vehicle.yaml"
mission { duration = "6 h", integrator = { method = p.method, relative = p.relative, max_step = p.max_step }, output = { period = "6 h" } }

-- Two bodies and the overlap of two discs, by SciPy's DOP853 with steps of at most 0.5 s and a relative tolerance of 1e-13, which agree with
-- those of 1 s to 1e-6 m.
local truth = { 6582986.63880916, -990953.54914907, -1296849.18528079 }
local body = sat:body "sat"
local function off() return vec.norm(vec.sub({ body:position() }, truth)) end
figure { name = "off after four revolutions", unit = "m", value = off }
-- An edge that is misplaced within steps of 30 s by some seconds: 7.6e-8 m/s^2 for these, three times along the track in 6 h, at eight edges.
check { name = "off after four revolutions", unit = "m", value = off, below = 0.01 }
