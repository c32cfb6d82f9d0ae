"""What the paper claims, computed: no plan and no stream needs any of it.

``topology`` counts degrees of freedom and coupling (Section 2.2 of [Shen2021]_), ``elimination``
derives the singular surfaces with sympy (Sections 3.2 and 3.3), ``figures`` draws the paper's
figures for any dimensions.
"""
