"""Newton's linear system by GMRES, preconditioned joint by joint and by the bodies' most compliant motions."""
