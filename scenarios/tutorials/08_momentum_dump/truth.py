"""Momentum of the wheels of this folder by the recursion of the controller: truth.py > truth.csv. Nothing but Python."""
print("t [s], wheel_x [N m s], wheel_y [N m s], wheel_z [N m s]")
for n in range(0, 361, 12):
    left = (1 - 10 / 600) ** n
    print(10 * n, repr(0.6 * left), repr(-0.4 * left), 0.3, sep=", ")
