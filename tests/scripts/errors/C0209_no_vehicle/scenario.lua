-- exit: 2
print("nothing")
