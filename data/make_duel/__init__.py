"""Makes the bundled demo: a sword fight of two people, choreographed together and then captured apart.

Run it from the project's root with `python -m data.make_duel`. Imports inside are relative because `data` is a folder
of files, not an installed package: under any other name the same code still runs.
"""
