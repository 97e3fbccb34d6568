"""The reach scene: a person who walks to a cube, takes it, and carries it, wherever it is put.

`walk` is the key-framed cycle, `legs` what is seen of it below the hips, `helpers` who helps an arm that is short,
`figure` the person with both arms solved, `scene` what happens when, `live` the same on a bus, in a view and into a
recording. All but `live` is pure.
"""
