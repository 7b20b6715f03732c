"""What a fit is good for elsewhere: kept beside fit.json, as C, as a physically consistent URDF or MJCF."""
