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
---@field method? "cvode_adams"|"cvode_bdf"|"dopri5"|"rk4" default dopri5
---@field linear_solver? "dense"|"krylov" of cvode_bdf, default dense
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
---@param last_stage? "position"|"inertia" default "inertia"
---@return Operators
function Vehicle:operators(last_stage) end

---@class LinearModel
---@field A Matrix x' = A x + B u
---@field B Matrix
---@field C Matrix y = C x + D u
---@field D Matrix
---@field drift Vector x' at the point
---@field u0 Vector
---@field y0 Vector
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
---@return number ax, number ay, number az [rad/s^2] node axes
function Node:angular_acceleration() end
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

--- Names and units along one side; each list may be left out.
---@class Labels
---@field names? string[]
---@field units? string[]

---@class Vector
---@operator add(Vector): Vector
---@operator sub(Vector): Vector
---@operator mul(number): Vector
---@operator div(number): Vector
---@operator unm: Vector
---@operator len: integer
---@field [integer|string] number
local Vector = {}
---@return Matrix one row
function Vector:t() end
---@param other Vector
---@return number
function Vector:dot(other) end
---@return number 2-norm
function Vector:norm() end
---@return number
function Vector:max_abs() end
---@return integer
function Vector:rows() end
---@return integer 1
function Vector:cols() end
---@return number[]
function Vector:table() end
---@return Labels
function Vector:labels() end
--- In the workbench alone.
---@param path string
function Vector:csv(path) end
--- In the workbench alone.
---@param path string
---@param name string of the dataset
function Vector:hdf5(path, name) end

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
---@return Matrix
function Matrix:t() end
---@param row integer|string
---@param column integer|string
---@param value number
function Matrix:set(row, column, value) end
---@param column integer|string
---@return Vector
function Matrix:column(column) end
---@overload fun(self, right: Matrix): Matrix
---@param right Vector|number[]
---@return Vector
function Matrix:solve(right) end
--- Of a symmetric matrix, ascending.
---@return Vector
function Matrix:eigenvalues() end
---@return number largest singular value
function Matrix:norm() end
---@return number
function Matrix:max_abs() end
---@return integer
function Matrix:rows() end
---@return integer
function Matrix:cols() end
---@return number[][]
function Matrix:table() end
---@return Labels rows, Labels columns
function Matrix:labels() end
--- In the workbench alone.
---@param path string
function Matrix:csv(path) end
--- In the workbench alone.
---@param path string
---@param name string of the dataset
function Matrix:hdf5(path, name) end

---@param values number[]
---@param labels? Labels
---@return Vector
function vector(values, labels) end
---@param rows number[][]
---@param row_labels? Labels
---@param column_labels? Labels
---@return Matrix
function matrix(rows, row_labels, column_labels) end

--- A spatial operator or an expression of them: docs/operators.md. Times a vector it is applied, in O(N).
---@class Operator
---@operator mul(Operator): Operator
---@operator mul(Vector): Vector
---@operator mul(Matrix): Matrix
---@operator mul(number): Operator
---@operator add(Operator): Operator
---@operator sub(Operator): Operator
---@operator unm: Operator
Operator = {}
---@return Operator adjoint
function Operator:star() end
--- By rule, never by a factorisation of the whole.
---@return Operator
function Operator:inv() end
---@return Matrix
function Operator:dense() end
---@return number largest singular value
function Operator:norm() end
--- The k largest eigenvalues of a symmetric operator, descending.
---@param k? integer default: all
---@return Vector
function Operator:eig(k) end
---@return integer
function Operator:rows() end
---@return integer
function Operator:cols() end
---@return string formula
function Operator:text() end

--- The operators of a tree, or of a part of it, at one state.
---@class Operators
---@field H Operator hinge x body
---@field phi Operator body x body
---@field E_phi Operator
---@field M Operator
---@field B Operator body x node
---@field P Operator
---@field P_plus Operator
---@field D Operator
---@field G Operator
---@field tau_bar Operator
---@field K Operator
---@field E_psi Operator
---@field psi Operator
---@field Y Operator
---@field Y_plus Operator
---@field dH Operator
---@field dE_phi Operator
---@field dM Operator
---@field I Operator
---@field mass Operator H phi M phi* H*
---@field omega Operator psi* H* D^-1 H psi
---@field jacobian Operator B* phi* H*
---@field mass_derivative Operator along the direction of `along`
Operators = {}
--- The same of a body and all outboard of it.
---@param body string
---@return Operators
function Operators:subtree(body) end
---@param from string
---@param to string
---@return Operators
function Operators:path(from, to) end
---@param bodies string[]
---@return Operators
function Operators:subgraph(bodies) end
--- B of these nodes.
---@param ... string
---@return Operator
function Operators:nodes(...) end
--- P, D, G anew: `free` lists the velocity components that are not given, W is added to the diagonal of D.
---@param options? {free?: string[], W?: Vector|number[]}
function Operators:articulate(options) end
--- Y, Y_plus.
function Operators:operational_space() end
--- dH, dE_phi, dM where q moves along u, or along one component.
---@param u Vector|number[]|string
function Operators:along(u) end
---@return number log of the determinant of the mass matrix
function Operators:log_det() end
---@param space "hinge"|"body"|"node"
---@return integer
function Operators:size(space) end
---@param space? "hinge"|"body"|"node"
---@return string[]
function Operators:names(space) end
--- J M^-1 J* of these nodes.
---@param ... string
---@return Matrix
function Operators:compliance(...) end
---@param task { nodes: string[], rows?: integer[], T?: Matrix, passive?: string[] }
---@return Task
function Operators:task(task) end
---@param node string
---@param direction number[] six: moment, force, node axes
---@return number
function Operators:effective_inertia(node, direction) end
---@param ... string
---@return { singular_values: Vector, kinematic: number, dynamic: number }
function Operators:manipulability(...) end
---@param node string
---@param direction number[]
---@return { shape: Vector, response: Vector, share: Vector }
function Operators:participation(node, direction) end
---@return { mass: number, com: Vector, inertia: Matrix } world axes
function Operators:mass_properties() end
---@param v Vector|number[]
---@param about? "world"|"com"
---@return Vector
function Operators:momentum(v, about) end
---@param about? "world"|"com"
---@return Matrix
function Operators:momentum_matrix(about) end
---@param v Vector|number[]
---@return { bodies: Matrix, total: Vector, angular?: Vector, linear?: Vector }
function Operators:momentum_sharing(v) end
---@return { others_locked: Vector, outboard_free: Vector, others_free: Vector }
function Operators:reflected_inertia() end
--- Velocity terms less gravity and elastic forces.
---@param v Vector|number[]
---@return Vector
function Operators:bias(v) end
---@param given { bias?: Vector, tau?: Vector, vdot?: Vector }
---@return { vdot: Vector, tau: Vector }
function Operators:hybrid(given) end
--- What the hinges transmit, at the origins and in the axes of the bodies, and the modal rows: body space.
---@param motion? { v?: Vector|number[], vdot?: Vector|number[] } default: v of the state, and the v' that its forces cause
---@return Vector
function Operators:interbody_forces(motion) end
--- The linear model of the bodies that take part, about the state that the operators were made at.
---@param ports? { inputs?: string[], outputs?: string[], file?: string } file: at the workbench alone
---@return LinearModel
function Operators:linearize(ports) end
---@param options? { elastic?: integer, rigid?: integer }
---@return { n_rigid: integer, first_elastic: integer, complete: boolean, frequency: Vector, damping: Vector, shapes: Matrix, strain: Matrix, kinetic: Matrix }
function Operators:system_modes(options) end
---@param body? string
---@return { tau_q?: Matrix, tau_v?: Matrix, vdot_q?: Matrix, vdot_v?: Matrix, vdot_tau?: Matrix, tau?: Matrix, vdot?: Matrix }
function Operators:derivatives(body) end
--- Bodies that take no part stay where they are.
---@param task { targets: { node: string, position?: quantity[], attitude?: number[], rows?: integer[], rotation_weight?: number, position_weight?: number }[], limits?: table<string, number[]>, free?: string[], prefer?: Vector, dynamic?: boolean, tolerance?: number, iterations?: integer, starts?: integer, seed?: integer }
---@return { reached: boolean, q: Vector, residual: number, error: Matrix, at_limit: string[], stationary: boolean, iterations: integer, starts: integer, seed: integer, message: string }
function Operators:inverse_kinematics(task) end
--- Components without actuator.
---@param ... string
---@return Passive
function Operators:passive(...) end
---@return Passive
function Operators:floating_base() end
---@return Vector
function Operators:log_det_gradient() end
---@param form? "normalised"|"rates"
---@return Diagonalised
function Operators:diagonalised(form) end

--- An operational space. x, F: of the task; v, tau: of the hinge space.
---@class Task
Task = {}
---@return Matrix
function Task:inertia() end
---@return Matrix
function Task:compliance() end
---@return integer
function Task:rank() end
---@return number
function Task:condition() end
---@return integer
function Task:rows() end
---@return Vector
function Task:rates(v) end
---@return Vector
function Task:forces(F) end
---@return Vector
function Task:consistent_inverse(x) end
---@return Vector
function Task:task_part(tau) end
---@return Vector
function Task:null_motion(v) end
---@return Vector
function Task:null_forces(tau) end
---@return Vector
function Task:torque(F, tau_0) end

---@class Passive
Passive = {}
---@return Vector
function Passive:velocities(v, momenta) end
--- Generalised Jacobian.
---@param ... string nodes
---@return Matrix
function Passive:jacobian(...) end
---@return Vector
function Passive:forces(tau) end
---@return Vector
function Passive:mass(vdot) end
---@return Matrix
function Passive:coupling() end

---@class Diagonalised
Diagonalised = {}
---@return Vector
function Diagonalised:nu(v) end
---@return Vector
function Diagonalised:velocity(nu) end
---@return Vector
function Diagonalised:eps(tau) end
---@return Vector
function Diagonalised:coriolis(v) end

--- The loaded scene.
---@class Sim
sim = {}
--- Spatial operators at the present state.
---@param last_stage? "position"|"inertia" default "inertia"
---@return Operators
function sim:operators(last_stage) end
--- The linear model about the state of now.
---@param ports? { inputs?: string[], outputs?: string[], file?: string } file: at the workbench alone
---@return LinearModel
function sim:linearize(ports) end
--- Modes of the assembled system, rigid-body modes first.
---@param options? { elastic?: integer, rigid?: integer }
---@return { n_rigid: integer, first_elastic: integer, complete: boolean, frequency: Vector, damping: Vector, shapes: Matrix, strain: Matrix, kinetic: Matrix }
function sim:system_modes(options) end
--- Derivatives of inverse and forward dynamics, or of both in the parameters of one body.
---@param body? string
---@return { tau_q?: Matrix, tau_v?: Matrix, vdot_q?: Matrix, vdot_v?: Matrix, vdot_tau?: Matrix, tau?: Matrix, vdot?: Matrix }
function sim:derivatives(body) end
---@param task { targets: { node: string, position?: quantity[], attitude?: number[], rows?: integer[], rotation_weight?: number, position_weight?: number }[], limits?: table<string, number[]>, free?: string[], prefer?: Vector, dynamic?: boolean, tolerance?: number, iterations?: integer, starts?: integer, seed?: integer }
---@return { reached: boolean, q: Vector, residual: number, error: Matrix, at_limit: string[], stationary: boolean, iterations: integer, starts: integer, seed: integer, message: string }
function sim:inverse_kinematics(task) end
---@return number [s]
function sim:t() end
---@return Vector
function sim:q() end
---@return Vector
function sim:v() end
---@return Vector
function sim:vdot() end
--- The state, or with an argument, in the workbench alone, sets what is given of it.
---@param new? {t?: quantity, q?: Vector|number[], v?: Vector|number[]}
---@return {t: number, q: Vector, v: Vector}
function sim:state(new) end
--- Runs the mission on; in the workbench alone.
---@param t number [s]
---@return number reached
function sim:run_to(t) end
---@return Vehicle
function sim:vehicle() end

vec = require "cardan.vec"
quat = require "cardan.quat"
allocation = require "cardan.allocation"
