"""The paper reproduced: one module an experiment, a table or figure of the paper or one beyond it."""
