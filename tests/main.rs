//! One test binary for the whole house; run with `cargo test --workspace`.
//!
//! | module | asks |
//! |---|---|
//! | `batches` | are several jobs accepted together, or none, and are they and their certificate lost by nothing? |
//! | `booleans` | do combined solids hold what their certificates say? |
//! | `clients` | do the Python and the TypeScript client follow the contract, and do their work? |
//! | `contacts` | are distances, places of contact and comparisons of shapes those of closed forms? |
//! | `corpus` | does every case of `fixtures/` hold, through the real command? |
//! | `fuzz` | are documents, mesh files and requests that nobody would write read or refused, without a panic? |
//! | `hostile` | does the service keep to its description whatever a program makes of that? |
//! | `independent` | do other people's libraries find in the files what the cases and the certificates say? |
//! | `levels` | are levels of systems the solids that closed forms say? |
//! | `measures` | are dimensions, centroids and inertia those of closed forms? |
//! | `progress` | is the error bound that was reached told while a job runs? |
//! | `properties` | do the laws of dilation hold on random sets, against brute force? |
//! | `regression` | do other repositories learn when their parts change? |
//! | `remote` | does the command line at a service leave what it leaves here? |
//! | `repairs` | are mesh files that are no solids refused, or repaired where that is asked for and told? |
//! | `determinism` | the same bytes for one thread and for two? |
//! | `contract` | is the committed OpenAPI what the service says, and does it keep its promises on paper? |
//! | `smooth` | have dilated curves and surfaces the topology, bounds and few triangles of closed forms? |
//! | `slices` | are plane sections the drawings that they should be? |
//! | `splits` | do the parts of a solid add up to it? |
//! | `thickness_maps` | are maps of thickness what closed forms and rays say, in files that others read? |
//! | `thickening` | do walls, closings and radii that vary hold their bounds? |
//! | `faults` | what does one process lose when it is killed, its disk is full, its clients misbehave? |
//! | `plans` | is what is predicted near what is made? |
//! | `polygons` | are concave polygons filled, and those without an inside refused? |
//! | `previews` | are previews what they say, and never taken for results? |
//! | `processes` | what does a job take with it when it takes down its process? |
//! | `distributed` | and several, with their database and object store? |
//! | `rolling` | are they restarted, traced and asked to stop without a loss? |
//! | `secure` | does the command line speak TLS, have metrics an address of their own, do traces arrive? |
//! | `service` | does the running service keep them? |
//! | `session` | does the page's session by curl run as it stands there? |
//! | `surface` | shortcuts, superseded jobs, rates, pages, parts and tags of files, pages of problems, what trades know: are they there? |
//! | `uploads` | are mesh files taken, refused and used as models are? |
//! | `architecture` | are the crates, the folders and the map what they claim to be? |
//! | `container` | do the container's files say what they must? |
//! | `composition` | and those that start several containers? |

#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod architecture;
mod batches;
mod booleans;
mod clients;
mod composition;
mod contacts;
mod container;
mod contract;
mod corpus;
mod determinism;
mod distributed;
mod faults;
mod fuzz;
mod hostile;
mod independent;
mod levels;
mod measures;
mod plans;
mod polygons;
mod previews;
mod processes;
mod progress;
mod properties;
mod regression;
mod remote;
mod repairs;
mod rolling;
mod secure;
mod service;
mod session;
mod slices;
mod smooth;
mod splits;
mod surface;
mod thickening;
mod thickness_maps;
mod uploads;
