"""The interactive program: `python -m pbd_gym.playground`.

A `Drawing` says what there is; `build_model` makes a Model of it, `Simulation` moves it, `View`
shows it, `Panel` and `tools` take what the user wants, and `App` runs the window.
"""
