// Moves all that is linked after it, and does nothing else. Where code lies decides some percent of its time: which branches share an
// entry of the processor's predictors. What is measured in several such places does not take that for a change of the code.
asm(".text\n.skip " CARDAN_PLACED ", 0xcc\n");
