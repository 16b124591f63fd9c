-- Eight penumbras of the Earth, each passed in 8 s, and how far off they leave an orbit: docs/mathematics/astronomy.md, 6.
local p = parameters { method = "dop853", relative = 1e-9, max_step = "6 h" }
local sat = vehicle "vehicle.yaml"
mission { duration = "6 h", integrator = { method = p.method, relative = p.relative, max_step = p.max_step }, output = { period = "6 h" } }

-- Two bodies and the overlap of two discs, by SciPy's DOP853 with steps of at most 0.5 s and a relative tolerance of 1e-13, which agree with
-- those of 1 s to 1e-6 m.
local truth = { 6582986.63880916, -990953.54914907, -1296849.18528079 }
local body = sat:body "sat"
local function off() return vec.norm(vec.sub({ body:position() }, truth)) end
figure { name = "off after four revolutions", unit = "m", value = off }
-- An edge that ends no step is misplaced by some seconds of 7.6e-8 m/s^2, three times that along the track in 6 h, each time: metres. With a
-- relative tolerance of 1e-9 the orbit itself is known to centimetres.
check { name = "off after four revolutions", unit = "m", value = off, below = 0.1 }
