---@meta
-- The scenario API for the Lua language server: completion, hover and checks while writing. Not part of the program; point
-- the server at this folder ("Lua.workspace.library": ["scripts/lua/cardan"]).

---@alias quantity number|string A number in SI units, or a text with a unit: "30 deg"
---@alias vector number[] Three numbers
---@alias quaternion number[] {w, x, y, z}

--- Numbers that the command line may replace: --set slew_angle="20 deg". Returned in SI units.
---@param values table<string, quantity|boolean|quantity[]>
---@return table<string, any>
function parameters(values) end

--- Loads a plugin, relative to the scenario's folder, before the vehicle.
---@param path string
function plugin(path) end

--- Reads the vehicle, computes its modes and compiles it.
---@param path string relative to the scenario's folder
---@return Vehicle
function vehicle(path) end

---@class IntegratorOptions
---@field method? "cvode_adams"|"cvode_bdf"|"dopri5"|"rk4" default cvode_adams
---@field relative? number relative tolerance, default 1e-9
---@field absolute? number absolute tolerance, default: the relative one
---@field step? quantity [s] of rk4
---@field initial_step? quantity [s]
---@field max_step? quantity [s]

---@class OutputOptions
---@field rate? quantity [Hz], default 10 Hz
---@field period? quantity [s], instead of the rate
---@field reactions? string[] bodies whose hinge reaction is recorded
---@field nodes? string[] nodes whose motion is recorded

---@class MissionOptions
---@field title? string
---@field duration quantity [s]
---@field integrator? IntegratorOptions
---@field output? OutputOptions
---@field ledger? boolean default true

---@class Mission
---@overload fun(options: MissionOptions)
mission = {}
--- Name of the present phase; "" before the first and after the last.
---@return string
function mission.phase() end
--- [s]
---@return number
function mission.time() end

--- Initial values by body: coordinates and velocities of its hinge by name, attitude, position, rate, velocity, eta, etadot.
---@param values table<string, table<string, quantity|quantity[]>>
function initial(values) end

--- Numbers of your own to record. Returns for each name the function that stores its numbers.
---@param declarations table<string, {unit?: string, components?: string[], frame?: string, meaning?: string}>
---@return table<string, fun(...: number)>
function signals(declarations) end

---@param options {name: string, rate?: quantity, period?: quantity, step: fun(t: number)}
function controller(options) end

---@param options {name: string, duration?: quantity, until_?: (fun(t: number): boolean), enter?: fun(t: number), exit_?: fun(t: number)}
function phase(options) end

---@param options {name: string, when: (fun(t: number): number), direction?: "rising"|"falling"|"both", action: fun(t: number)}
function event(options) end

--- Ends the run.
function stop() end

--- An acceptance check, evaluated at the end. Limits are numbers in `unit`.
---@param options {name: string, value: (fun(): number), unit?: string, below?: number, above?: number, within?: number[], equal?: table}
function check(options) end

--- A number of the summary.
---@param options {name: string, value: (fun(): number), unit?: string}
function figure(options) end

---@class Vehicle
local Vehicle = {}
---@param name string
---@return Body
function Vehicle:body(name) end
--- The inboard hinge of a body.
---@param body string
---@return Hinge
function Vehicle:hinge(body) end
---@param body string
---@return Modes
function Vehicle:modes(body) end
---@param name string "bus.thruster_1", or a body for its origin
---@return Node
function Vehicle:node(name) end
---@return number kg
function Vehicle:mass() end

---@class LinearModel
---@field A number[][] x' = A x + B u
---@field B number[][]
---@field C number[][] y = C x + D u
---@field D number[][]
---@field drift number[] x' at the point
---@field u0 number[]
---@field y0 number[]
---@field t number [s]
---@field poles { re: number, im: number, frequency: number, damping: number }[] [rad/s], [Hz]
---@field state_names string[]
---@field state_units string[]
---@field input_names string[]
---@field input_units string[]
---@field output_names string[]
---@field output_units string[]

--- The linear model about the state of now.
---@param ports? { inputs?: string[], outputs?: string[] } "wheel.angle", "bus.tip:force", "bus:attitude"
---@return LinearModel
function Vehicle:linearize(ports) end

---@class Body
local Body = {}
---@return number w, number x, number y, number z body to world
function Body:attitude() end
---@return number wx, number wy, number wz [rad/s] body axes
function Body:rate() end
---@return number x, number y, number z [m] world axes
function Body:position() end
---@return number vx, number vy, number vz [m/s] world axes
function Body:velocity() end
---@return number kg
function Body:mass() end

---@class Hinge
local Hinge = {}
---@param component? integer|string default 1
---@return number [rad] or [m]
function Hinge:q(component) end
Hinge.angle = Hinge.q
---@param component? integer|string
---@return number [rad/s] or [m/s]
function Hinge:v(component) end
Hinge.rate = Hinge.v
--- Sets the force of the actuator, held until it is set again.
---@param value number [N m] or [N]
---@param component? integer|string
function Hinge:force(value, component) end
Hinge.torque = Hinge.force
--- The force of the actuator; of a prescribed component, that which its motion needs.
---@param component? integer|string
---@return number
function Hinge:applied(component) end
--- Moment and force that the hinge transmits to the body, at and in the axes of its pnode.
---@return number mx, number my, number mz, number fx, number fy, number fz
function Hinge:reaction() end
--- The motion of a prescribed component: exactly one of rate_table, sine, hold.
---@param options {component?: integer|string, rate_table?: quantity[][], sine?: {amplitude: quantity, frequency: quantity, phase?: quantity}, hold?: quantity}
function Hinge:profile(options) end

---@class Modes
local Modes = {}
---@param mode integer
---@return number
function Modes:eta(mode) end
---@param mode integer
---@return number
function Modes:etadot(mode) end
---@return integer
function Modes:count() end
---@param mode integer
---@return number Hz
function Modes:frequency(mode) end

---@class Node
local Node = {}
---@return number x, number y, number z [m] world axes
function Node:position() end
---@return number w, number x, number y, number z node to world
function Node:attitude() end
---@return number wx, number wy, number wz [rad/s] node axes
function Node:rate() end
---@return number vx, number vy, number vz [m/s] world axes
function Node:velocity() end
---@return number ax, number ay, number az [m/s^2] world axes
function Node:acceleration() end
--- Declares a load on the node, zero at first; before the run.
---@param options? {axes?: "node"|"world"}
---@return Load
function Node:load(options) end

---@class Load
local Load = {}
--- Sets the load, held until it is set again.
---@param mx number [N m]
---@param my number
---@param mz number
---@param fx number [N]
---@param fy number
---@param fz number
function Load:set(mx, my, mz, fx, fy, fz) end

vec = require "cardan.vec"
quat = require "cardan.quat"
allocation = require "cardan.allocation"
