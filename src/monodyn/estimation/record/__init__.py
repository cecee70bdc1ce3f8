"""Tables of joint positions in and out; samples whitened and smoothed."""
