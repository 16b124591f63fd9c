-- exit: 2
-- it was the length of the first three of its numbers
print(vec.norm { 0.6, 0, 0, 0.8 })
