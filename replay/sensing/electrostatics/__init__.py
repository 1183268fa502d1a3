"""The electrostatics of conductors: the methods `bem` and `field` of the capacitive sensor (METHODS 4.5).

In reading order: `panels`, `faces` and `grading` are the mesh of a surface, `refinement` what nearness asks of it;
`influence` is the potential that a panel makes on another, `cholesky` solves; `unit` is the sensors' side with its own
charges, `body` the other side, `placement` both in one pose, `algebra` what the bodies change then. `bem` is the
reference; `nodes`, `memory`, `cut`, `potential_grid` and `field` are the fast method. `spline`, `proxy` and `keyframes`
read many frames from few. `conductors` makes units and bodies of what a scene declares, `gap` and `contacts` tell what
touches, `motion` goes over frames, `circuit` gives the voltages, and `suite` is all of it for a block.
"""
