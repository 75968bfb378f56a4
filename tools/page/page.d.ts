// Which kind of element has a name, index.html says, and not the scripts.
interface Document { getElementById(id: string): any }
interface ParentNode { querySelector(selectors: string): any }
