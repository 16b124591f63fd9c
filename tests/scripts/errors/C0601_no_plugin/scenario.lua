-- exit: 2
plugin "helix.so"
