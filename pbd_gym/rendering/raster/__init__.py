"""Compiled loops over pixels: lines, discs and polygons in the plane, surfaces in space.

Every function writes into arrays that it is given. A pixel with row r and column c covers the
square from (c, r) to (c + 1, r + 1); coordinates are (x, y), y down.
"""
