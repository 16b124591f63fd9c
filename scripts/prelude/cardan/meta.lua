---@meta
-- The scenario API: what it takes and gives, in SI units unless told otherwise. One source for three readers: the Lua language
-- server (point it at this folder: "Lua.workspace.library": ["scripts/prelude/cardan"]), `help` and TAB at the prompt, and a test
-- that compares it with what scripts find. Not run by the program.

---@alias quantity number|string A number in SI units, or a text with a unit: "30 deg"
---@alias component integer|string 1, 2, ... or a name: "angle" or "rate" name the same component of a hinge

-- ---- declarations ----

--- Numbers that the command line may replace: --set slew_angle="20 deg". Returned in SI units. With a spread, each seed but 0 draws it anew:
--- { "500 kg", normal = "10 kg" } (standard deviation; `within`: never off by more), { "90 deg", uniform = "3 deg" } (87 to 93 deg).
---@param values table<string, quantity|boolean|quantity[]> quantities, arrays of them, texts, true or false, by name
---@return table<string, any> values by the same names
function parameters(values) end

--- Loads a plugin, before the vehicle. It is native code: trust it like a program.
---@param path string relative to the scenario's folder
function plugin(path) end

--- Reads the vehicle, computes its modes and compiles it. One per scenario.
---@param path string relative to the scenario's folder
---@param values? table<string, number|string|number[]> of the vehicle file, by key path: { ["bodies.bus.mass"] = 500 }
---@return Vehicle vehicle
function vehicle(path, values) end

---@class TolerancesByKind
---@field angle? quantity [rad] of hinges and attitudes
---@field position? quantity [m]
---@field rate? quantity [rad/s]
---@field velocity? quantity [m/s]
---@field modes? number in place of `absolute`, scaled for each mode

---@class IntegratorOptions
---@field method? "ark_explicit"|"ark_imex"|"ark_implicit"|"auto"|"cvode_adams"|"cvode_bdf"|"dop853"|"dopri5"|"exponential"|"extended"|"ida"|"multirate"|"rk4"|"variational"|"variational4" default dopri5
---@field linear_solver? "dense"|"krylov"|"sparse" of cvode_bdf and ark_implicit; default dense; of ida: sparse
---@field relative? number relative tolerance, default 1e-9
---@field absolute? number absolute tolerance; default: the relative one
---@field tolerances? TolerancesByKind absolute ones of a kind of states, in place of `absolute`
---@field step? quantity [s] of rk4, variational, variational4
---@field initial_step? quantity [s]
---@field max_step? quantity [s]

---@class OutputOptions
---@field rate? quantity [Hz] default 10 Hz
---@field period? quantity [s] instead of the rate
---@field reactions? string[] bodies whose hinge reaction is recorded
---@field nodes? string[] nodes whose motion is recorded
---@field between_steps? boolean rows, and ticks of sensors whose readings change no motion, lie inside of steps and do not end them; default false

---@class CheckpointOptions
---@field period? quantity [s] default a tenth of the duration, in whole periods of the output
---@field never? boolean no checkpoints: the run cannot be resumed

---@class BudgetOptions
---@field steps? number of one call of a controller, phase, event, check or figure, default 1e8: about half a second
---@field time? quantity [s] of one call, default 10 s

---@class MissionOptions
---@field title? string
---@field duration quantity [s]
---@field integrator? IntegratorOptions
---@field dynamics? "standard"|"diagonalised"|"diagonalised_rates"|"dense" which velocities are integrated, or accelerations by the dense twin, cubic in their number; default standard
---@field output? OutputOptions
---@field checkpoint? CheckpointOptions when the run is made so that it can be resumed
---@field ledger? boolean balance of momentum and energy, default true
---@field budget? BudgetOptions what one call of a function of the mission may spend

--- Declares the mission; mission.time() and mission.phase() ask.
---@class Mission
---@overload fun(options: MissionOptions)
mission = {}
--- Name of the present phase; "" before the first and after the last.
---@return string name
function mission.phase() end
--- How long the present phase lasts by now; 0 before the first and after the last.
---@return number t [s]
function mission.phase_time() end
--- Ends the present phase and begins another, when the controller, phase function or action of an event that says so has returned, or the sequence waits.
---@param name string
function mission.enter(name) end
--- The time; in `when` of an event that of the trial state.
---@return number t [s]
function mission.time() end

--- Initial values by body, as `initial` of a hinge in the vehicle: coordinates and velocities of its hinge by name, or attitude
--- (quaternion_wxyz, orientation), position, rate (angular_velocity), velocity as a whole, and eta, etadot of its modes. Before the run.
---@param values table<string, table<string, quantity|quantity[]>> { bus = { rate = {0, 0, "1 deg/s"} }, wing = { angle = "5 deg" } }
function initial(values) end

---@class SignalOptions
---@field unit? string of all components, default 1
---@field components? string[] names of its numbers; default: one, the signal's own name
---@field frame? string in which its numbers are
---@field meaning? string a line for the reader
---@field commands? string the recorded attitude that this quaternion w, x, y, z commands: "bodies/bus/attitude"; the report shows the angles between them

--- Numbers of your own to record. A value that is not finite is recorded, and warned about.
---@param declarations table<string, SignalOptions> by name; "pointing/error" puts it into a folder
---@return table<string, fun(...: number)> store for each name the function that stores its numbers
function signals(declarations) end

--- A table that controllers, phases and actions change, and that is in every checkpoint, so that a run can be resumed: numbers, texts,
--- truths, vectors, matrices and tables of these. What is kept in other variables is in none.
---@generic T: table
---@param memory T its values at the start
---@return T memory the same table
function persist(memory) end

---@class ControllerOptions
---@field name string
---@field rate? quantity [Hz] or the period
---@field period? quantity [s]
---@field step fun(t: number) called at its ticks, t in s

--- A function that runs at a fixed rate, never inside an integration step.
---@param options ControllerOptions
function controller(options) end

---@class DeviceTypeOptions
---@field type string its name in the vehicle file, lua/damper
---@field summary? string
---@field mounts? table<string, "node"|"hinge"|"gravity"|"magnetic"|"density"|"wind"|"light"|"position"|"attitude"|"time"|{reads: "node"|"hinge"}|{field: string, at?: string, optional?: boolean}> where it is mounted and which fields it reads there, the keys of the vehicle file
---@field params? table<string, string|number|table> numbers of the vehicle file: a unit, a default, or { default, unit }
---@field inputs? table<string, string|number|table> the same
---@field outputs? table<string, string|number|table> what it gives
---@field memory? table<string, string|number|table> numbers that tick sets; in every checkpoint
---@field states? table<string, string|number|table> continuous states, with in_step
---@field tick? fun(a: table, dt: number): table at the ticks of its rate: outputs and memory by their names
---@field in_step? boolean evaluate runs inside of the right-hand side
---@field evaluate? fun(a: table): table outputs, rates of states, and loads: of a hinge a number, of a node { force, moment }

--- A type of devices for prototypes, before `vehicle`: functions of what they are handed, and of nothing else.
---@param options DeviceTypeOptions
function device(options) end

---@class PhaseOptions
---@field name string
---@field duration? quantity [s]
---@field until_? fun(t: number): boolean it is over when this is true, or its duration has passed
---@field enter? fun(t: number) called at its beginning
---@field exit_? fun(t: number) called at its end
---@field next? string name of the phase that follows it; default: the one that is declared after it

--- Phases follow one another in the order of their declaration, unless `next` or mission.enter() say otherwise.
---@param options PhaseOptions
function phase(options) end

---@class EventOptions
---@field name string
---@field when fun(t: number): number zero at the event; reads t, coordinates and rates of hinges and modes, states of devices, nothing else
---@field direction? "rising"|"falling"|"both" default both
---@field once? boolean not looked at after it has happened; beside direction
---@field action? fun(t: number) called at the crossing; may set commands

--- Something that is located by root finding to the integrator's accuracy.
---@param options EventOptions
function event(options) end

---@class SequenceOptions
---@field name string
---@field run fun() the plan, from top to bottom; waits by wait, at and wait_until
---@field start? boolean with the run, default; false: where Sequence:start() says so

--- A plan that waits: for durations, times, conditions. It may do what a controller may.
---@param options SequenceOptions
---@return Sequence sequence
function sequence(options) end

--- In a sequence: what follows is later by this.
---@param duration quantity [s]
function wait(duration) end

--- In a sequence: what follows is at this time of the mission.
---@param time quantity [s] from now on
function at(time) end

---@class WaitOptions
---@field rate? quantity [Hz] looks at these ticks whether it is true; without it, and without period, the zero of a number is located
---@field period? quantity [s] the same
---@field direction? "rising"|"falling"|"both" of a number that is located, default both: the next zero; on its side already, it does not wait
---@field timeout? quantity [s] from now on: then it returns false
---@field otherwise? fun() after the timeout, in place of the rest of the plan

--- In a sequence: what follows is where a number is zero, located as events are, or where something is true, looked at by ticks.
---@param condition fun(t: number): number|boolean a number; with a rate true or false
---@param options? WaitOptions
---@return boolean holds false after a timeout
function wait_until(condition, options) end

--- A plan of the mission, which sequence{...} returns.
---@class Sequence
local Sequence = {}
--- Begins, from its first line, in this instant; before the run, with it. Refused while it is under way.
function Sequence:start() end
--- Ends it where it waits.
function Sequence:stop() end
---@return "idle"|"ready"|"waiting"|"running"|"ended"|"stopped" state
function Sequence:state() end
--- What it waits for, with its line; "" if it does not wait.
---@return string wait
function Sequence:waits_for() end

--- Ends the run: from a controller, a sequence, a phase or an event's action.
function stop() end

---@class CheckOptions
---@field name string
---@field value fun(): number in `unit`, called at the end
---@field unit? string default 1
---@field below? number exactly one of below, above, within, equal; limits are numbers in `unit`
---@field above? number
---@field within? number[] {smallest, largest}
---@field equal? table {x, tolerance = e}

--- An acceptance check, evaluated at the end of the run.
---@param options CheckOptions
function check(options) end

---@class FigureOptions
---@field name string
---@field value fun(): number in `unit`, called at the end
---@field unit? string default 1

--- A number of the summary.
---@param options FigureOptions
function figure(options) end

-- ---- studies ----

---@class LinearPorts
---@field inputs? string[] "wheel.angle" or "wheel.rate": force on that component; "wheel": all of its hinge; "wing.eta_2": force on a mode; "bus.tip:force", "bus.tip:torque.x": on a node, node axes; "wheel:torque": an input of a device. Default: all hinges
---@field outputs? string[] "wing.angle", "wing.rate", "wing.eta_2", "wing.etadot_2": a state; "wing": all of a body; "bus.tip:position", ":velocity", ":acceleration" (world axes), ":attitude", ":rate", ":specific_force" (node axes); "momentum:linear", "momentum:angular"; "wheel:rate": an output of a device, "wheel.momentum": a state of one. Default: all states
---@field file? string .m, .h5 or .json, below --out; at the workbench alone

---@class LinearModel
---@field A Matrix x' = A x + B u, x = [deviations of coordinates; of velocities]
---@field B Matrix
---@field C Matrix y = C x + D u
---@field D Matrix
---@field drift Vector x' at the point; zero in equilibrium
---@field u0 Vector inputs at the point
---@field y0 Vector outputs at the point
---@field t number [s]
---@field poles { re: number, im: number, frequency: number, damping: number }[] of A, rising: re, im in rad/s, frequency in Hz, damping -re/|pole| (0 where the pole is zero to rounding)
---@field state_names string[]
---@field state_units string[]
---@field input_names string[]
---@field input_units string[]
---@field output_names string[]
---@field output_units string[]
---@field file? string where it was written

---@class ModesOptions
---@field elastic? integer how many elastic modes, lowest first; default 10
---@field rigid? integer shapes of at most so many rigid-body modes; default 12

---@class SystemModes
---@field n_rigid integer how many rigid-body modes there are
---@field first_elastic integer column of the first elastic mode
---@field complete boolean none was missed (Sylvester)
---@field frequency Vector [Hz] 0 for rigid-body modes
---@field damping Vector ratio to critical
---@field shapes Matrix velocity components x modes, mass-normalised
---@field strain Matrix share of each component's stiffness in the strain energy
---@field kinetic Matrix share of each body in the kinetic energy

---@class Derivatives
---@field tau_q? Matrix of inverse dynamics in the configuration; not with closed loops
---@field tau_v? Matrix ... in the velocities; not with closed loops
---@field vdot_q? Matrix of forward dynamics in the configuration; with closed loops in the independent components, the others following
---@field vdot_v? Matrix ... in the velocities, likewise
---@field vdot_tau? Matrix ... in the forces: the inverse mass matrix
---@field tau? Matrix of inverse dynamics in the parameters of the body; not with closed loops
---@field vdot? Matrix of forward dynamics in them

---@class IkTarget
---@field node string "arm.tip", or a body for its origin
---@field position? quantity[] [m] where it should be, world axes
---@field attitude? number[] {w, x, y, z} node axes to world
---@field rows? integer[] which of the six rows count: 1 2 3 rotation, 4 5 6 position, along the target's axes; {1, 2} leaves the turn about z free. Default: all of what is given
---@field rotation_weight? number [1/rad] of rotation rows in the residual, default 1
---@field position_weight? number [1/m] of position rows, default 1

---@class IkTask
---@field targets IkTarget[]
---@field limits? table<string, number[]> {["arm.angle"] = {lower, upper}} [rad], [m]
---@field free? string[] components that may move: "arm.rate", "arm.angle", "arm" for its hinge, "wing.eta" for its modes. Default: all hinges, no mode
---@field prefer? Vector posture to be near to among the solutions, as sim:q()
---@field dynamic? boolean moves little what is heavy (mass matrix); default false
---@field tolerance? number of the weighted residual, default 1e-12
---@field iterations? integer per start, default 200
---@field starts? integer the present posture, then random ones; default 8
---@field seed? integer of the random starts; default that of the run

---@class IkResult
---@field reached boolean
---@field q Vector the solution, or the nearest posture found
---@field initial table<string, table> the same as initial takes it; rates are not in it
---@field residual number weighted norm of all rows that count
---@field error Matrix per target, [rotation; position] in target axes
---@field at_limit string[] components that stand at a limit
---@field stationary boolean not reached, and no small move comes nearer
---@field iterations integer
---@field starts integer
---@field seed integer
---@field message string

---@class EquilibriumTask
---@field move string[] components that may move, and are at rest then: "boom.angle", "boom" for its hinge, "wing.eta" for its modes
---@field iterations? integer at most, of each of two searches, default 50
---@field tolerance? number of the last step, default 1e-12 [rad, m]

---@class EquilibriumResult
---@field reached boolean
---@field statically_stable boolean no small move drives itself on; else only what spins may hold it
---@field q Vector the posture, or the nearest that was found
---@field v Vector rates there: zero of what may move
---@field initial table<string, table> the same as initial takes it
---@field residual number the largest acceleration left of what may move
---@field iterations integer
---@field message string

--- What sim, a vehicle and operators answer about a state.
---@class Scene
local Scene = {}
--- The linear model x' = A x + B u, y = C x + D u about the state, forces and loads of now (of operators: of then), exact to round-off. With closed
--- loops x has the independent components alone (state_names); the others may be outputs.
---@param ports? LinearPorts
---@return LinearModel model
function Scene:linearize(ports) end
--- Modes of the assembled system, hinge springs and bodies' modes together, rigid-body modes first. Printed, it says which mode is what.
---@param options? ModesOptions
---@return SystemModes modes
function Scene:system_modes(options) end
--- Derivatives of inverse and forward dynamics; or of both in the parameters of one body: its inertia (m, h, J), or its modal stiffness. With closed
--- loops those of forward dynamics.
---@param body? string
---@return Derivatives derivatives
function Scene:derivatives(body) end
--- The configuration in which nodes stand where they should. A target out of reach is a result with the nearest posture. Closed loops stay closed.
---@param task IkTask
---@return IkResult result
function Scene:inverse_kinematics(task) end

---@class State
---@field t number [s]
---@field q Vector
---@field v Vector

---@class NewState
---@field t? quantity [s]
---@field q? Vector|number[] quaternions are normalised
---@field v? Vector|number[]

--- The loaded scene, a global.
---@class Sim: Scene
sim = {}
--- The vehicle with its loops closed as one system, where it is now.
---@return ClosedSystem system
function sim:closed_system() end
--- The posture near that of now in which what may move stays at rest, under forces and commands of now; all else stands or moves as it does now.
---@param task EquilibriumTask
---@return EquilibriumResult result
function sim:equilibrium(task) end
--- The time; in `when` of an event that of the trial state.
---@return number t [s]
function sim:t() end
--- Coordinates, in the order of the vehicle's bodies, a hinge before its modes.
---@return Vector q [rad], [m], modes [1]
function sim:q() end
--- Velocities, in the same order.
---@return Vector v [rad/s], [m/s], modes [1/s]
function sim:v() end
--- Accelerations that the forces of now cause.
---@return Vector vdot [rad/s^2], [m/s^2], modes [1/s^2]
function sim:vdot() end
--- The state, a copy; at the workbench, with an argument, sets what is given. A new run begins there.
---@param new? NewState
---@return State state
function sim:state(new) end
--- Runs the mission on, with its controllers, sequences, phases and events; at the workbench alone.
---@param t quantity [s]
---@return number t [s] the time that was reached
function sim:run_to(t) end
--- What `vehicle` returned.
---@return Vehicle vehicle
function sim:vehicle() end
--- The spatial operators at the present state; they stay there when the scene moves on.
---@param last_stage? "position"|"inertia" default "inertia"
---@return Operators operators
function sim:operators(last_stage) end

-- ---- handles ----

--- What `vehicle` returns; hands out bodies, hinges, modes and nodes by name.
---@class Vehicle: Scene
local Vehicle = {}
--- The vehicle with its loops closed as one system, where it is now.
---@return ClosedSystem system
function Vehicle:closed_system() end
--- The posture near that of now in which what may move stays at rest, under forces and commands of now; all else stands or moves as it does now.
---@param task EquilibriumTask
---@return EquilibriumResult result
function Vehicle:equilibrium(task) end
---@param name string
---@return Body body
function Vehicle:body(name) end
--- The inboard hinge of a body.
---@param body string
---@return Hinge hinge
function Vehicle:hinge(body) end
--- The modes of a flexible body.
---@param body string
---@return Modes modes
function Vehicle:modes(body) end
---@param name string "bus.thruster_1", or a body for its origin
---@return Node node
function Vehicle:node(name) end
---@param name string
---@return Device device
function Vehicle:device(name) end
---@param name string
---@return Loop loop
function Vehicle:loop(name) end
--- Mass of all bodies.
---@return number mass [kg]
function Vehicle:mass() end
--- Other values in the vehicle from the end of this instant on: its text is read and compiled again. States, commands and profiles are
--- kept; what a change does to momentum and energy is told in the results (event `model`).
---@param values table<string, string|number> key paths: { ["bodies.tank.mass"] = "3 kg" }
function Vehicle:change(values) end
--- From the end of this instant on the hinge of the body is this one: what the body carries comes along, no body jumps, momentum is kept.
---@param body string
---@param hinge table as the vehicle file writes it: { to = "station.port", at = "tip" }, `locked` without a type; as_found = true: held as it is
function Vehicle:attach(body, hinge) end
--- From the end of this instant on the body flies freely, with all that hangs on it.
---@param body string
function Vehicle:detach(body) end
--- From the end of this instant on the hinge of the body holds the coordinates that it has.
---@param body string
function Vehicle:lock(body) end
--- From the end of this instant on the hinge of the body moves.
---@param body string
function Vehicle:unlock(body) end
--- From the end of this instant on the loop holds; its ends must meet.
---@param loop string
function Vehicle:close(loop) end
--- From the end of this instant on the loop exerts nothing.
---@param loop string
function Vehicle:open(loop) end
--- The spatial operators at the present state.
---@param last_stage? "position"|"inertia" default "inertia"
---@return Operators operators
function Vehicle:operators(last_stage) end

--- A body of the vehicle.
---@class Body
local Body = {}
--- Quaternion of body axes to world axes.
---@return number w, number x, number y, number z
function Body:attitude() end
--- Angular velocity, body axes.
---@return number wx, number wy, number wz [rad/s]
function Body:rate() end
--- Of its origin, world axes.
---@return number x, number y, number z [m]
function Body:position() end
--- Of its origin, world axes.
---@return number vx, number vy, number vz [m/s]
function Body:velocity() end
---@return number mass [kg]
function Body:mass() end

--- The inboard hinge of a body.
---@class Hinge
local Hinge = {}
--- A coordinate.
---@param component? component default 1
---@return number q [rad] or [m]
function Hinge:q(component) end
Hinge.angle = Hinge.q
--- A velocity.
---@param component? component default 1
---@return number v [rad/s] or [m/s]
function Hinge:v(component) end
Hinge.rate = Hinge.v
--- Sets the force of the actuator, held until it is set again.
---@param value number [N m] or [N]
---@param component? component default 1
function Hinge:force(value, component) end
Hinge.torque = Hinge.force
--- The force of the actuator; of a prescribed component that of its drive: what the motion needs beside springs, friction, devices and
--- couplings of the hinge.
---@param component? component default 1
---@return number force [N m] or [N]
function Hinge:applied(component) end
--- Moment and force that the hinge transmits to the body, at its pnode and in pnode axes.
---@return number mx, number my, number mz, number fx, number fy, number fz [N m], [N]
function Hinge:reaction() end

--- What closes a loop, or couples coordinates.
---@class Loop
local Loop = {}
--- Moment and force that it transmits to its end `to`, at that node, axes of the node `from`; zero while it is open.
---@return number mx, number my, number mz, number fx, number fy, number fz [N m], [N]
function Loop:reaction() end
--- Of a distance the force that pushes its ends apart, of a coupling that per slope of its sum along each coordinate.
---@return number multiplier [N], [1]
function Loop:multiplier() end
--- Of a distance, as it is now; of a coupling its offset.
---@return number length [m], [1]
---@return number rate [m/s], [1/s]
function Loop:length() end
Loop.offset = Loop.length
--- By how much the length or offset is more, from now on, of a loop that the vehicle declares `prescribed`: exactly one of rate_table, sine,
--- hold, in m or, of a coupling, as numbers. Where its rate jumps the vehicle takes it as a blow.
---@param options ProfileOptions
function Loop:profile(options) end

---@class SineOptions
---@field amplitude quantity [rad] or [m]
---@field frequency quantity [Hz]
---@field phase? quantity [rad] default 0

---@class ProfileOptions
---@field component? component default 1
---@field rate_table? quantity[][] {{t, rate}, ...} linear between the points, constant beyond; t in s, rising
---@field sine? SineOptions of the coordinate: from where it is at t_0, when this is said, by amplitude (sin(2 pi frequency t + phase) - sin(2 pi frequency t_0 + phase))
---@field hold? quantity [rad/s] or [m/s] a constant rate

--- The motion of a component that the vehicle declares `prescribed`: exactly one of rate_table, sine, hold.
---@param options ProfileOptions
function Hinge:profile(options) end

--- The modes of a flexible body, cantilevered or free as its modal source has them.
---@class Modes
local Modes = {}
--- Modal coordinate.
---@param mode integer
---@return number eta [1]
function Modes:eta(mode) end
---@param mode integer
---@return number etadot [1/s]
function Modes:etadot(mode) end
---@return integer n
function Modes:count() end
--- Of the body alone; sim:system_modes() has those of the assembled system.
---@param mode integer
---@return number frequency [Hz]
function Modes:frequency(mode) end

---@class LoadOptions
---@field axes? "node"|"world" axes of its components, default node

--- A node of the vehicle, or the origin of a body.
---@class Node
local Node = {}
--- World axes.
---@return number x, number y, number z [m]
function Node:position() end
--- Quaternion of node axes to world axes.
---@return number w, number x, number y, number z
function Node:attitude() end
--- Angular velocity, node axes.
---@return number wx, number wy, number wz [rad/s]
function Node:rate() end
--- Node axes.
---@return number ax, number ay, number az [rad/s^2]
function Node:angular_acceleration() end
--- Acceleration less gravity there, as an accelerometer reads it; node axes.
---@return number fx, number fy, number fz [m/s^2]
function Node:specific_force() end
--- World axes.
---@return number vx, number vy, number vz [m/s]
function Node:velocity() end
--- World axes, gravity not subtracted.
---@return number ax, number ay, number az [m/s^2]
function Node:acceleration() end
--- Declares a load on the node, zero at first; before the run.
---@param options? LoadOptions
---@return Load load
function Node:load(options) end

--- A load on a node.
---@class Load
local Load = {}
--- Sets moment and force, held until they are set again.
---@param mx number [N m]
---@param my number [N m]
---@param mz number [N m]
---@param fx number [N]
---@param fy number [N]
---@param fz number [N]
function Load:set(mx, my, mz, fx, fy, fz) end

--- A device of the vehicle.
---@class Device
local Device = {}
--- Sets an input that is not connected, held until it is set again.
---@param input string its name, as `cardan types TYPE` tells; "torque" is torque_x, torque_y and torque_z, or torque_1 to torque_n
---@param value number|number[] in the unit of the input; of a vector a list
function Device:set(input, value) end
--- An output, an input, a state or a mark, by its name; a vector of outputs or inputs by the name that they share.
---@param name string
---@return number|number[] value
function Device:get(name) end
--- Whether an output holds, by what its device says of it; true where that says nothing.
---@param output string its name, or that of a vector
---@return boolean valid
function Device:valid(output) end
--- A port has a fault: whoever reads it, the script too, gets scale x + bias + drift (t - from) + noise in place of x, or what it is stuck
--- at. It begins and ends at these instants, which end steps; events of the results tell them. A port has one fault at a time:
--- where another one begins it takes its place.
---@class PortFault
---@field port string an output or an input; of a vector its name, then numbers are of all or lists
---@field scale? number|number[] 1 if absent; -1 turns the sign
---@field bias? number|string|(number|string)[] in the unit of the port
---@field drift? number|string|(number|string)[] [unit of the port / s]
---@field stuck? true|number|string|(number|string)[] true: at what it is when the fault begins; 0: dead. With none of the others
---@field noise? number|string|(number|string)[] standard deviation, drawn at each tick of its device, which samples
---@field drop? number|number[] probability that a tick is lost: the number before it stays
---@field delay? number|string|(number|string)[] [s] x is what it was so long ago: whole ticks of its device, which samples
---@field swap? string another port of the device, which exchanges its value with this one; with none of the others
---@field from? number|string [s], now if absent
---@field until_? number|string [s]; without it until `mend`
---@param fault PortFault
function Device:fault(fault) end
--- Ends the fault that the port has now; those to come stay.
---@param port string
function Device:mend(port) end

-- ---- vectors and matrices ----

--- Names and units along one side, a text for each entry; each list may be left out.
---@class Labels
---@field names? string[]
---@field units? string[]

--- Numbers with names and units: x[i], x["rod.angle"], #x, x + y, x - y, 2 * x, x / 2, -x, x == y.
---@class Vector
---@operator add(Vector): Vector
---@operator sub(Vector): Vector
---@operator mul(number): Vector
---@operator div(number): Vector
---@operator unm: Vector
---@operator len: integer
---@field [integer|string] number
local Vector = {}
--- Transpose.
---@return Matrix row one row
function Vector:t() end
---@param other Vector
---@return number product
function Vector:dot(other) end
--- 2-norm.
---@return number norm
function Vector:norm() end
--- Largest magnitude.
---@return number largest
function Vector:max_abs() end
---@return integer rows
function Vector:rows() end
---@return integer cols 1
function Vector:cols() end
--- A plain table of its numbers.
---@return number[] numbers
function Vector:table() end
---@return Labels labels
function Vector:labels() end
--- Writes a text file, a line per row, below --out; at the workbench alone.
---@param path string
---@return string path where it went
function Vector:csv(path) end
--- Writes a dataset, names and units as attributes; the file keeps what else it holds. At the workbench alone.
---@param path string
---@param name string of the dataset
---@return string path where it went
function Vector:hdf5(path, name) end

--- A matrix with names and units along both sides: A(i, j), A[i] (a copy of the row), A + B, A - B, A * B, A * x, 2 * A, A / 2, -A.
---@class Matrix
---@operator add(Matrix): Matrix
---@operator sub(Matrix): Matrix
---@operator mul(Matrix): Matrix
---@operator mul(Vector): Vector
---@operator mul(number): Matrix
---@operator div(number): Matrix
---@operator unm: Matrix
---@operator len: integer
---@operator call(integer|string, integer|string): number
---@field [integer|string] Vector a copy of the row
local Matrix = {}
--- Transpose.
---@return Matrix transpose
function Matrix:t() end
--- Sets one entry.
---@param row integer|string
---@param column integer|string
---@param value number
function Matrix:set(row, column, value) end
---@param column integer|string
---@return Vector column
function Matrix:column(column) end
--- x with A x = b, by LU with rows and columns scaled; a singular matrix is an error.
---@param b Vector|Matrix|number[]
---@return Vector|Matrix x
function Matrix:solve(b) end
--- Of a symmetric matrix, ascending.
---@return Vector values
function Matrix:eigenvalues() end
--- Largest singular value.
---@return number norm
function Matrix:norm() end
--- Largest magnitude of an entry.
---@return number largest
function Matrix:max_abs() end
---@return integer rows
function Matrix:rows() end
---@return integer cols
function Matrix:cols() end
--- A plain table of rows.
---@return number[][] rows
function Matrix:table() end
--- Of the rows, then of the columns.
---@return Labels rows, Labels columns
function Matrix:labels() end
--- Writes a text file, a line per row, below --out; at the workbench alone.
---@param path string
---@return string path where it went
function Matrix:csv(path) end
--- Writes a dataset, names and units as attributes; the file keeps what else it holds. At the workbench alone.
---@param path string
---@param name string of the dataset
---@return string path where it went
function Matrix:hdf5(path, name) end

--- Makes a vector of numbers.
---@param values number[]
---@param labels? Labels
---@return Vector x
function vector(values, labels) end
--- Makes a matrix of rows.
---@param rows number[][]
---@param row_labels? Labels
---@param column_labels? Labels
---@return Matrix A
function matrix(rows, row_labels, column_labels) end

-- ---- operators ----

--- A spatial operator or an expression of them: A * B, A + B, A - B, 2 * A, -A; A * x applies it, in O(N) (docs/operators.md).
---@class Operator
---@operator mul(Operator): Operator
---@operator mul(Vector): Vector
---@operator mul(Matrix): Matrix
---@operator mul(number): Operator
---@operator add(Operator): Operator
---@operator sub(Operator): Operator
---@operator unm: Operator
local Operator = {}
--- The adjoint.
---@return Operator adjoint
function Operator:star() end
--- The inverse by rule, never by a factorisation of the whole.
---@return Operator inverse
function Operator:inv() end
--- As a matrix.
---@return Matrix A
function Operator:dense() end
--- Largest singular value.
---@return number norm
function Operator:norm() end
--- The k largest eigenvalues of a symmetric operator, descending.
---@param k? integer default: all
---@return Vector values
function Operator:eig(k) end
---@return integer rows
function Operator:rows() end
---@return integer cols
function Operator:cols() end
--- Its formula.
---@return string formula
function Operator:text() end

---@class ArticulateOptions
---@field free? string[] components that are not given: "arm.rate", "arm.angle", "arm" for its hinge, "wing.eta" for its modes
---@field W? Vector|number[] hinge space, added to the diagonal of D

---@class TaskOptions
---@field nodes string[]
---@field rows? integer[] of the 6 rows of each node, one node after the other: 1 2 3 rotation, 4 5 6 translation, node axes
---@field T? Matrix combinations of them, instead of rows
---@field passive? string[] components that carry no actuator: "base" for its hinge, "wing.eta" for its modes, "arm.rate"

---@class Motion
---@field v? Vector|number[] default: that of the state
---@field vdot? Vector|number[] default: what the forces of the state cause

---@class HybridOptions
---@field bias? Vector|number[] forces at v' = 0, as s:bias(v); default 0
---@field tau? Vector|number[] read for free components; default 0
---@field vdot? Vector|number[] read for the others; default 0

---@class CompoundBody
---@field bodies string[] that move against each other in its loops
---@field home string the body that they hang on, or "world"
---@field loops string[]
---@field independent string[] its components in the hinge space

--- The operators of a tree, or of a part of it, or of the tree of compound bodies that closed loops leave, at one state; spaces: hinge
--- (velocity components, of closed loops the independent ones), rate (all of them), body ([V; eta'] per body), node.
---@class Operators: Scene
---@field H Operator hinge x body: relative velocities are H* v
---@field phi Operator body x body: gathers forces tip to base
---@field E_phi Operator body x body: phi = (I - E_phi)^-1
---@field M Operator body x body: inertias
---@field B Operator body x node: velocities of nodes are B* V
---@field P Operator body x body: articulated body inertia
---@field P_plus Operator body x body: what is felt through the hinge
---@field D Operator hinge x hinge: H P H*
---@field G Operator body x hinge: P H* D^-1
---@field tau_bar Operator body x body: I - G H
---@field K Operator body x hinge: E_phi G
---@field E_psi Operator body x body: E_phi tau_bar
---@field psi Operator body x body: (I - E_psi)^-1
---@field Y Operator body x body: block diagonal of omega; after operational_space()
---@field Y_plus Operator body x body; after operational_space()
---@field dH Operator along the direction of along()
---@field dE_phi Operator along the direction of along()
---@field dM Operator along the direction of along()
---@field X Operator rate x hinge: v = X v_I; of an open tree the identity
---@field dX Operator along the direction of along()
---@field I Operator identity of the space that it meets
---@field mass Operator H phi M phi* H*
---@field omega Operator psi* H* D^-1 H psi
---@field jacobian Operator B* phi* H*
---@field mass_derivative Operator along the direction of along()
local Operators = {}
--- The same of a body and all outboard of it.
---@param body string
---@return Operators part
function Operators:subtree(body) end
--- The same of the bodies on the way from one to another.
---@param from string
---@param to string
---@return Operators part
function Operators:path(from, to) end
--- The same of these bodies.
---@param bodies string[]
---@return Operators part
function Operators:subgraph(bodies) end
--- B of these nodes.
---@param ... string
---@return Operator B
function Operators:nodes(...) end
--- P, D, G anew: some components given, a diagonal added to D.
---@param options? ArticulateOptions
function Operators:articulate(options) end
--- Computes Y, Y_plus.
function Operators:operational_space() end
--- dH, dE_phi, dM, dX where q moves along u, or along a component; of closed loops as the independent ones of u say.
---@param u Vector|number[]|string
function Operators:along(u) end
--- Logarithm of the determinant of the mass matrix.
---@return number log_det
function Operators:log_det() end
--- The compound bodies that closed loops make of several; without loops none.
---@return CompoundBody[] compounds
function Operators:compounds() end
---@param space "hinge"|"body"|"node"|"rate"
---@return integer size
function Operators:size(space) end
--- Names of the numbers of a space.
---@param space? "hinge"|"body"|"node"|"rate" default "hinge"
---@return string[] names
function Operators:names(space) end
--- J M^-1 J* of these nodes, 6 s x 6 s, node axes.
---@param ... string
---@return Matrix compliance
function Operators:compliance(...) end
--- An operational space: what forces on nodes do to the motion of nodes.
---@param task TaskOptions
---@return Task task
function Operators:task(task) end
--- The inertia felt by a push along a direction, all else free.
---@param node string
---@param direction number[] six: moment, force, node axes
---@return number inertia [kg m^2] or [kg]
function Operators:effective_inertia(node, direction) end
--- How well nodes can be moved: singular values of J, sqrt det(J J*), sqrt det(J M^-1 J*).
---@param ... string nodes
---@return { singular_values: Vector, kinematic: number, dynamic: number } manipulability
function Operators:manipulability(...) end
--- How each component takes part in the motion of a node along a direction; shares sum to 1.
---@param node string
---@param direction number[] six: rotation, translation, node axes
---@return { shape: Vector, response: Vector, share: Vector } participation
function Operators:participation(node, direction) end
--- Mass [kg], mass centre [m] and inertia about it [kg m^2], world axes.
---@return { mass: number, com: Vector, inertia: Matrix } properties
function Operators:mass_properties() end
--- Angular [N m s] and linear [N s] momentum of the bodies, world axes. What a momentum_wheel has stored is its output `momentum`.
---@param v Vector|number[] velocities
---@param about? "world"|"com" default "world"
---@return Vector momentum six
function Operators:momentum(v, about) end
--- A with momentum = A v.
---@param about? "world"|"com" default "world"
---@return Matrix A
function Operators:momentum_matrix(about) end
--- Momentum per body, and its share of the total.
---@param v Vector|number[] velocities
---@return { bodies: Matrix, total: Vector, angular?: Vector, linear?: Vector } sharing
function Operators:momentum_sharing(v) end
--- Inertia felt at each component.
---@return { others_locked: Vector, outboard_free: Vector, others_free: Vector } inertia
function Operators:reflected_inertia() end
--- C - gravity - elastic forces of modes at these velocities: forces at v' = 0, without springs and dampers of hinges.
---@param v Vector|number[] velocities
---@return Vector forces
function Operators:bias(v) end
--- Of free components by their forces, of the others by their accelerations (after articulate{free = ...}).
---@param given HybridOptions
---@return { vdot: Vector, tau: Vector } motion
function Operators:hybrid(given) end
--- What the hinges transmit, at the origins and in the axes of the bodies, and the modal rows: body space.
---@param motion? Motion
---@return Vector forces
function Operators:interbody_forces(motion) end
--- Components without actuator.
---@param ... string "base" for its hinge, "wing.eta" for its modes, "arm.rate"
---@return Passive passive
function Operators:passive(...) end
--- The hinges of all roots as components without actuator.
---@return Passive passive
function Operators:floating_base() end
--- Derivatives of log_det along each component.
---@return Vector gradient
function Operators:log_det_gradient() end
--- Velocities in which the kinetic energy is a sum of squares.
---@param form? "normalised"|"rates" default "normalised"
---@return Diagonalised diagonalised
function Operators:diagonalised(form) end

---@class ClosedTaskOptions
---@field nodes string[]
---@field rows? integer[] as in TaskOptions
---@field T? Matrix combinations of them, instead of rows

--- What loops leave of the mass matrix at one state: motions that they allow, and what forces do to them (docs/operators.md).
---@class ClosedSystem
local ClosedSystem = {}
--- Ways to move, given motions left out.
---@return integer mobility
function ClosedSystem:mobility() end
--- Names of the components that choose a motion, given ones among them; the others follow.
---@return string[] components
function ClosedSystem:independent() end
--- Y, a motion a column: Y* M Y = 1, and Y Y* is the inverse of the mass matrix of the closed system.
---@return Matrix Y
function ClosedSystem:motions() end
--- Y Y* tau: the accelerations of the system at rest under hinge forces alone.
---@param tau Vector|number[]
---@return Vector vdot
function ClosedSystem:respond(tau) end
--- Its task space, with Y Y* in place of the inverse of the mass matrix.
---@param options ClosedTaskOptions
---@return Task task
function ClosedSystem:task(options) end
--- Forces of actuators, beside those of now, with which independent components accelerate so; the least of several.
---@param vdot Vector|number[]
---@param actuated string[] components
---@return { tau: Vector, missing: Vector } forces missing: what these actuators cannot give
function ClosedSystem:inverse_dynamics(vdot, actuated) end
--- log det of the mass matrix of the independent components that are free, X* M X.
---@return number value
function ClosedSystem:log_det() end
--- Its derivative along each of them, those that depend on it following.
---@return Vector gradient
function ClosedSystem:log_det_gradient() end
--- Diagonalised velocities Y* M v: kinetic energy 1/2 nu* nu of what is free.
---@param v Vector|number[] [rad/s], [m/s], modes [1/s]
---@return Vector nu
function ClosedSystem:nu(v) end
--- Y nu.
---@param nu Vector|number[]
---@return Vector v
function ClosedSystem:velocity(nu) end
--- Y* tau.
---@param tau Vector|number[]
---@return Vector eps
function ClosedSystem:eps(tau) end
--- C of nu' + C = eps, velocity terms alone; nu* C = 0.
---@param nu Vector|number[]
---@return Vector C
function ClosedSystem:coriolis(nu) end
--- Spatial operators of its tree without the loops, at the same place: letters, expressions, factors.
---@return Operators operators
function ClosedSystem:open_tree() end

--- An operational space. x, F: rows of the task; v, tau: of the hinge space. What s:task{...} returns.
---@class Task
local Task = {}
--- Lambda, the inertia felt by the rows.
---@return Matrix inertia
function Task:inertia() end
--- Lambda^-1 = J M^-1 J*.
---@return Matrix compliance
function Task:compliance() end
--- Independent directions among the rows.
---@return integer rank
function Task:rank() end
---@return number condition
function Task:condition() end
---@return integer rows
function Task:rows() end
--- J v.
---@param v Vector|number[]
---@return Vector rates
function Task:rates(v) end
--- J* F: hinge forces of a task force.
---@param F Vector|number[]
---@return Vector tau
function Task:forces(F) end
--- J# x = M^-1 J* Lambda x.
---@param x Vector|number[]
---@return Vector v
function Task:consistent_inverse(x) end
--- J#* tau: the task force in hinge forces.
---@param tau Vector|number[]
---@return Vector F
function Task:task_part(tau) end
--- Motion that leaves the task alone.
---@param v Vector|number[]
---@return Vector v
function Task:null_motion(v) end
--- Forces that do not accelerate the task.
---@param tau Vector|number[]
---@return Vector tau
function Task:null_forces(tau) end
--- J* F + N* tau_0: task force and posture.
---@param F Vector|number[]
---@param tau_0? Vector|number[] default 0
---@return Vector tau
function Task:torque(F, tau_0) end
--- Jdot v: accelerations of the rows at v' = 0, node axes.
---@param v Vector|number[]
---@return Vector bias
function Task:bias(v) end
--- Lambda (wanted - drift): the task force for wanted accelerations; drift: those that happen without it, J v' + bias.
---@param wanted Vector|number[]
---@param drift? Vector|number[] default 0
---@return Vector F
function Task:force_for(wanted, drift) end
--- An error (N0401) where the rank is below the rows.
function Task:require_full_rank() end

--- Components without actuator: what s:passive{...} and s:floating_base() return.
---@class Passive
local Passive = {}
--- Velocities of all components, those without actuator from their momenta.
---@param v Vector|number[] read for the others
---@param momenta? Vector|number[] as many as v, read where there is no actuator; default 0
---@return Vector v
function Passive:velocities(v, momenta) end
--- Generalised Jacobian of these nodes.
---@param ... string
---@return Matrix J
function Passive:jacobian(...) end
--- Forces that do the same work through the actuated components.
---@param tau Vector|number[]
---@return Vector tau
function Passive:forces(tau) end
--- Reduced mass matrix times accelerations.
---@param vdot Vector|number[]
---@return Vector tau
function Passive:mass(vdot) end
--- Velocities of passive components per velocity of the others, at no momentum.
---@return Matrix coupling
function Passive:coupling() end

--- Diagonalised velocities: what s:diagonalised() returns.
---@class Diagonalised
local Diagonalised = {}
--- nu of velocities: T = nu* nu / 2.
---@param v Vector|number[]
---@return Vector nu
function Diagonalised:nu(v) end
---@param nu Vector|number[]
---@return Vector v
function Diagonalised:velocity(nu) end
--- Forces along nu.
---@param tau Vector|number[]
---@return Vector eps
function Diagonalised:eps(tau) end
--- Velocity terms: nu' + C = eps, nu* C = 0.
---@param v Vector|number[]
---@return Vector C
function Diagonalised:coriolis(v) end

--- Dates, how the Earth stands (IAU 2006/2000A) and where celestial bodies are, in axes of the GCRS. A date is a text with its scale,
--- "2026-11-26T12:00:00 UTC" (or UT1, TT, TAI; UTC without), "JD 2453750.5 + 0.892 UTC", "MJD 61370.5 TT", from 1960 to 2200; `t` seconds
--- may follow it, dut1 = UT1 - UTC [s].
---@class Astro
astro = {}
--- A date in another scale, as a Julian date in two parts.
---@param date string
---@param scale? "UTC"|"TAI"|"TT"|"UT1" default TT
---@param dut1? number [s]
---@return number days a Julian date that ends with .5
---@return number fraction of a day
function astro.julian_date(date, scale, dut1) end
--- TAI - UTC.
---@param year number
---@param month number
---@param day number
---@return number seconds
function astro.leap_seconds(year, month, day) end
--- The angle by which the Earth has turned.
---@param date string
---@param t? number [s]
---@param dut1? number [s]
---@return number angle [rad]
function astro.earth_rotation_angle(date, t, dut1) end
--- Sidereal time of Greenwich.
---@param date string
---@param t? number [s]
---@param dut1? number [s]
---@return number mean [rad]
---@return number apparent [rad]
function astro.sidereal_time(date, t, dut1) end
--- Nutation, and the mean obliquity of the ecliptic.
---@param date string
---@param t? number [s]
---@return number longitude [rad]
---@return number obliquity [rad]
---@return number mean_obliquity [rad]
function astro.nutation(date, t) end
--- The celestial intermediate pole, and what places the origins of longitude.
---@param date string
---@param t? number [s]
---@return number X [1]
---@return number Y [1]
---@return number s the CIO locator [rad]
---@return number s_prime the TIO locator [rad]
function astro.intermediate_pole(date, t) end
--- Bias, precession and nutation: from the GCRS to the true equator and equinox of date.
---@param date string
---@param t? number [s]
---@return Matrix rows
function astro.precession_nutation(date, t) end
--- The axes of the Earth (ITRS) as columns, in world axes that are those of the GCRS.
---@param date string
---@param t? number [s]
---@param dut1? number [s]
---@param x? number polar motion [rad]
---@param y? number polar motion [rad]
---@param dX? number what observation adds to the celestial pole [rad]
---@param dY? number the same [rad]
---@return Matrix axes
function astro.earth_axes(date, t, dut1, x, y, dX, dY) end
--- The axes of a celestial body as columns: along its prime meridian, east of it, along its axis; of the IAU's report of 2015, of the Earth
--- those of earth_axes; moon_principal: the principal axes of the Moon.
---@param body "sun"|"moon"|"mercury"|"venus"|"earth"|"mars"|"jupiter"|"saturn"|"uranus"|"neptune"|"moon_principal"
---@param date string
---@param t? number [s]
---@return Matrix axes
function astro.axes(body, date, t) end
--- Where a celestial body is, as the fields third_body and sunlight have it.
---@param body "sun"|"moon"|"mercury"|"venus"|"earth"|"mars"|"jupiter"|"saturn"|"uranus"|"neptune"
---@param date string
---@param t? number [s]
---@param origin? string the body from whose centre, default earth
---@return number[] position [m]
function astro.position(body, date, t, origin) end
--- The gravitational parameter of a celestial body in DE440, from Mars on with its moons.
---@param body string
---@return number gm [m^3/s^2]
function astro.gm(body) end
--- What NRLMSISE-00 tells of the air at a place and a time, all species; the field of that name has `drag_density`.
---@param asked { day: integer, seconds: quantity, altitude: quantity, latitude: quantity, longitude: quantity, solar_time: quantity, f107: number, f107_average: number, ap: number|number[] } day of the year from 1, time of the day (UT), geodetic place, local solar time (by the longitude), F10.7 of the day before and over 81 days, ap of the day (4) or seven of the 57 h before
---@return { density: number, drag_density: number, temperature: number, exosphere: number, He: number, O: number, N2: number, O2: number, Ar: number, H: number, N: number, hot_O: number } air [kg/m^3] without anomalous oxygen and with it, [K] there and far above, numbers [1/m^3]
function astro.nrlmsise00(asked) end
--- On the ellipsoid WGS 84.
---@param place Vector|number[] axes of the Earth [m]
---@return number longitude [rad] to the east
---@return number latitude [rad] geodetic
---@return number height [m]
function astro.geodetic(place) end
---@param longitude number [rad] to the east
---@param latitude number [rad] geodetic
---@param height number [m] above the ellipsoid WGS 84
---@return number[] place axes of the Earth [m]
function astro.from_geodetic(longitude, latitude, height) end

--- Feedback and filters of linear models: matrices as of linearize, weights as a symmetric matrix, a list of its diagonal, or one number.
---@class Control
control = {}
--- The regulator u = -K x of x' = A x + B u with the least integral of x* Q x + u* R u.
---@param A Matrix
---@param B Matrix
---@param Q Matrix|number[]|number
---@param R Matrix|number[]|number
---@return Matrix K
---@return Matrix X of the equation of Riccati: x* X x is what is to be paid from x on
function control.lqr(A, B, Q, R) end
--- The same of x+ = A x + B u at ticks.
---@param A Matrix
---@param B Matrix
---@param Q Matrix|number[]|number
---@param R Matrix|number[]|number
---@return Matrix K
---@return Matrix X
function control.dlqr(A, B, Q, R) end
--- The filter z' = A z + B u + L (y - C z) of x' = A x + B u + w, y = C x + v, with white noise of densities W, V.
---@param A Matrix
---@param C Matrix
---@param W Matrix|number[]|number
---@param V Matrix|number[]|number
---@return Matrix L
---@return Matrix P covariance of z - x
function control.kalman(A, C, W, V) end
--- The filter at ticks: z = z + L (y - C z) at a reading, then z = A z + B u to the next; W, V are covariances.
---@param A Matrix
---@param C Matrix
---@param W Matrix|number[]|number
---@param V Matrix|number[]|number
---@return Matrix L
---@return Matrix P covariance of z - x before a reading
function control.dkalman(A, C, W, V) end
--- x' = A x + B u + w between two ticks, with u constant and noise w of density W.
---@param A Matrix
---@param B Matrix
---@param dt number [s]
---@param W? Matrix|number[]|number
---@return Matrix Ad
---@return Matrix Bd
---@return Matrix? Wd covariance of the noise from one tick to the next
function control.discretise(A, B, dt, W) end
--- Eigenvalues of A, of x+ = A x where dt is told, as the motions that belong to them.
---@param A Matrix
---@param dt? number [s]
---@return { re: number, im: number, frequency: number, damping: number }[] poles rising; re, im in rad/s, frequency in Hz, damping of critical
function control.poles(A, dt) end
--- What a sine of an input makes of an output of x' = A x + B u, y = C x + D u, or of x+ = A x + B u where dt is told.
---@param A Matrix
---@param B Matrix
---@param C Matrix
---@param D? Matrix default 0
---@param frequency number [Hz]
---@param dt? number [s]
---@return Matrix gain
---@return Matrix phase [rad] from -pi to pi
function control.response(A, B, C, D, frequency, dt) end

vec = require "cardan.vec"
quat = require "cardan.quat"
allocation = require "cardan.allocation"
elliptic = require "cardan.elliptic"
cmg = require "cardan.cmg"
slosh = require "cardan.slosh"
slew = require "cardan.slew"
orbit = require "cardan.orbit"
